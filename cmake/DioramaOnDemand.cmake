# diorama_add_on_demand_library(NAME SOURCES ... LINK ...): a library of the host that the program
# maps when it meets what needs it, so that what it links is not loaded by every command.
function(diorama_add_on_demand_library name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;LINK")
  add_library(${name} MODULE ${arg_SOURCES})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE diorama::sdk ${arg_LINK} diorama_build_flags)
  set_target_properties(${name} PROPERTIES PREFIX "" LIBRARY_OUTPUT_DIRECTORY
                                                     ${PROJECT_BINARY_DIR}/on_demand)
  install(TARGETS ${name} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/diorama)
  add_dependencies(diorama_engine ${name})
endfunction()
