# diorama_add_plugin(NAME SOURCES file... [LINK target...])
#
# Builds the plugin library NAME.so: a module with hidden symbols and without a lib prefix, placed in
# <build>/plugins and installed where the host looks (diorama_sdk_PLUGIN_DIR). The link fails when
# anything is undefined or when no source says DIORAMA_PLUGIN(...), which makes the entry point and
# the descriptor section.
include(CheckLinkerFlag)

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
  # The run-time libraries of sanitizers are left undefined on purpose.
  if(NOT DIORAMA_SANITIZE AND NOT "${CMAKE_CXX_FLAGS}" MATCHES "-fsanitize=")
    target_link_options(${name} PRIVATE -Wl,--no-undefined)
  endif()
  # Not every linker can demand a symbol.
  check_linker_flag(CXX -Wl,--require-defined=main DIORAMA_LINKER_HAS_REQUIRE_DEFINED)
  if(DIORAMA_LINKER_HAS_REQUIRE_DEFINED)
    target_link_options(${name} PRIVATE -Wl,--require-defined=diorama_plugin)
  endif()
  if(NOT DEFINED diorama_sdk_PLUGIN_DIR)
    set(diorama_sdk_PLUGIN_DIR ${CMAKE_INSTALL_LIBDIR}/diorama/plugins-${DIORAMA_SDK_ABI})
  endif()
  install(TARGETS ${name} LIBRARY DESTINATION ${diorama_sdk_PLUGIN_DIR} COMPONENT plugins)
endfunction()
