# Packs the build as `cpack --preset release` does, unpacks it in a folder with an odd name and runs a
# job there: plugins, samples and templates are those of the tarball.
#   cmake -DCPACK=... -DBUILD=... -DWORK=... -P tarball.cmake
cmake_minimum_required(VERSION 3.25)
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY "${WORK}/any folder")

function(run)
  execute_process(COMMAND ${ARGV} WORKING_DIRECTORY ${WORK} RESULT_VARIABLE result
                  OUTPUT_VARIABLE out ERROR_VARIABLE err)
  if(NOT result EQUAL 0)
    list(JOIN ARGV " " command)
    message(FATAL_ERROR "${command}\nended with ${result}\n${out}${err}")
  endif()
  set(OUT "${out}" PARENT_SCOPE)
endfunction()

run(${CPACK} --config ${BUILD}/CPackConfig.cmake -G TGZ -B ${WORK}/packed)
file(GLOB tarball ${WORK}/packed/diorama-*.tar.gz)
file(ARCHIVE_EXTRACT INPUT ${tarball} DESTINATION "${WORK}/any folder")
cmake_path(GET tarball FILENAME name)
string(REGEX REPLACE "\\.tar\\.gz$" "" name ${name})
set(place "${WORK}/any folder/${name}")
if(NOT EXISTS "${place}/share/doc/diorama/LICENSE")
  message(FATAL_ERROR "the tarball has no licence")
endif()

# Without anything that points elsewhere.
set(diorama ${CMAKE_COMMAND} -E env --unset=DIORAMA_PLUGIN_PATH --unset=DIORAMA_ASSETS_ROOT
            --unset=LD_LIBRARY_PATH XDG_DATA_HOME=${WORK}/nothing "${place}/bin/diorama")
run(${diorama} doctor)
string(REGEX MATCHALL "[^\n]*, (/[^\n]*\\.so)" plugins "${OUT}")
list(LENGTH plugins count)
if(count LESS 5)
  message(FATAL_ERROR "few plugins were found:\n${OUT}")
endif()
foreach(line IN LISTS plugins)
  string(FIND "${line}" "${place}/" at)
  if(at EQUAL -1)
    message(FATAL_ERROR "a plugin from elsewhere: ${line}")
  endif()
endforeach()
string(FIND "${OUT}" "root ${place}/share/diorama/assets" at)
if(at EQUAL -1)
  message(FATAL_ERROR "the samples of the tarball were not found:\n${OUT}")
endif()
run(${diorama} new-plugin writer my_boxes --dir ${WORK}/my_boxes)
run(${diorama} run "${place}/share/diorama/configs/smoke.yaml" --output ${WORK}/dataset)
run(${diorama} lint ${WORK}/dataset)
