# diorama_add_plugin(NAME SOURCES file... [LINK target...])
#
# Builds the plugin library NAME.so: a module with hidden symbols, nothing undefined, no lib prefix,
# placed in <build>/plugins and installed where the host looks.
function(diorama_add_plugin name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;LINK")
  if(NOT arg_SOURCES)
    message(FATAL_ERROR "diorama_add_plugin(${name}): no SOURCES")
  endif()
  add_library(${name} MODULE ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE diorama::sdk ${arg_LINK})
  if(TARGET diorama_build_flags)
    target_link_libraries(${name} PRIVATE diorama_build_flags)
  endif()
  target_compile_features(${name} PRIVATE cxx_std_20)
  set_target_properties(
    ${name}
    PROPERTIES PREFIX ""
               CXX_EXTENSIONS OFF
               CXX_VISIBILITY_PRESET hidden
               VISIBILITY_INLINES_HIDDEN ON
               LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/plugins)
  if(NOT DIORAMA_SANITIZE)
    target_link_options(${name} PRIVATE -Wl,--no-undefined)
  endif()
  if(NOT DEFINED diorama_sdk_PLUGIN_DIR)
    set(diorama_sdk_PLUGIN_DIR ${CMAKE_INSTALL_LIBDIR}/diorama/plugins-${DIORAMA_SDK_ABI})
  endif()
  install(TARGETS ${name} LIBRARY DESTINATION ${diorama_sdk_PLUGIN_DIR} COMPONENT plugins)
endfunction()
