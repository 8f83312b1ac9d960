# diorama_add_plugin(NAME SOURCES file... [LINK target...])
#
# Builds the plugin library NAME.so: a module with hidden symbols and without a lib prefix, placed in
# <build>/plugins and installed into diorama_sdk_PLUGIN_DIR, which is where the program looks below
# its own prefix, below /usr/local, which is CMake's own choice, and below ~/.local. Optimised unless
# a build type says otherwise; floating point is not contracted, so that machines agree. The link fails
# when anything is undefined or when no source says DIORAMA_PLUGIN(...), which makes the entry point
# and the descriptor section.
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
  target_compile_options(${name} PRIVATE -ffp-contract=off $<$<CONFIG:>:-O2>)
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
  if(DEFINED diorama_sdk_PREFIX)
    diorama_say_where_installed()
  endif()
endfunction()

# Says at the installation when the program would not find the plugins by itself.
function(diorama_say_where_installed)
  get_property(is_said DIRECTORY PROPERTY diorama_says_where_installed)
  if(is_said OR IS_ABSOLUTE ${diorama_sdk_PLUGIN_DIR})
    return()
  endif()
  set_property(DIRECTORY PROPERTY diorama_says_where_installed ON)
  install(
    CODE
      "set(folder \"\${CMAKE_INSTALL_PREFIX}/${diorama_sdk_PLUGIN_DIR}\")
cmake_path(COMPARE \"\${CMAKE_INSTALL_PREFIX}\" EQUAL \"${diorama_sdk_PREFIX}\" is_found)
foreach(prefix IN ITEMS /usr/local \"\$ENV{HOME}/.local\")
  if(CMAKE_INSTALL_PREFIX STREQUAL prefix)
    set(is_found ON)
  endif()
endforeach()
if(NOT is_found AND NOT DEFINED ENV{DESTDIR})
  message(\"Diorama does not look there by itself: set DIORAMA_PLUGIN_PATH=\${folder}, or install with --prefix ~/.local\")
endif()"
    COMPONENT plugins)
endfunction()
