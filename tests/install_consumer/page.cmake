# Runs the commands of the page for plugin authors, all but the installation of packages, which the
# installed build stands for (packaging/test-deb.sh runs that, too).
include(${CMAKE_CURRENT_LIST_DIR}/steps.cmake)
set(place ${WORK}/page)
file(REMOVE_RECURSE ${place})
file(MAKE_DIRECTORY ${place})
run(${REPOSITORY}/packaging/page_commands.sh ${REPOSITORY}/sdk/docs/writing_a_plugin.md)
string(REGEX REPLACE "(^|\n)apt install [^\n]*" "" commands "${OUT}")
if(NOT commands MATCHES "diorama new-plugin writer my_boxes\n" OR commands MATCHES "apt ")
  message(FATAL_ERROR "not the commands of the page:\n${OUT}")
endif()
file(WRITE ${place}/commands.sh "set -eux\n${commands}")
run(${CMAKE_COMMAND} -E env PATH=${PREFIX}/${BINDIR}:$ENV{PATH} LD_LIBRARY_PATH=${PREFIX}/${LIBDIR}
    CMAKE_PREFIX_PATH=${PREFIX} CMAKE_GENERATOR=${GENERATOR} CXX=${CXX}
    CMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER} XDG_DATA_HOME=${place}
    ${CMAKE_COMMAND} -E chdir ${place} sh commands.sh)
expect_text("label,x_min,y_min,x_max,y_max")
file(GLOB tables ${place}/_out_my_boxes/boxes/*/*.csv)
if(NOT tables)
  message(FATAL_ERROR "no dataset was written:\n${OUT}")
endif()
