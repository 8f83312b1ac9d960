# cmake -D CLANGXX=... -D SOURCE=... -D BUILD=... -D OPTIMIZATION=-O1 -D SECONDS=... -P run_usd_fuzzer.cmake
# Builds the fuzzer and runs it for a while. Seeds are the small shared files, where they are there.
include(${CMAKE_CURRENT_LIST_DIR}/run.cmake)

cmake_host_system_information(RESULT processors QUERY NUMBER_OF_LOGICAL_CORES)
run(${CMAKE_COMMAND} -S ${SOURCE}/tests/fuzz/usd -B ${BUILD} -DCMAKE_CXX_COMPILER=${CLANGXX}
    -DDIORAMA_FUZZ_OPTIMIZATION=${OPTIMIZATION})
run(${CMAKE_COMMAND} --build ${BUILD} --parallel ${processors})
file(MAKE_DIRECTORY ${BUILD}/corpus ${BUILD}/seeds)
if(EXISTS ${SOURCE}/../shared/data/usd)
  file(GLOB_RECURSE files ${SOURCE}/../shared/data/usd/*.usd ${SOURCE}/../shared/data/usd/*.usda
       ${SOURCE}/../shared/data/usd/*.usdc ${SOURCE}/../shared/data/usd/*.usdz)
  foreach(file ${files})
    file(SIZE ${file} size)
    if(size LESS 20000)
      string(MD5 name ${file})
      configure_file(${file} ${BUILD}/seeds/${name} COPYONLY)
    endif()
  endforeach()
else()
  file(WRITE ${BUILD}/seeds/text "#usda 1.0\ndef Cube \"C\"\n{\n    double size = 2\n}\n")
endif()
# Some seeds take 7 s where code is not optimized, alone on a machine.
run(${BUILD}/usd_fuzzer -max_total_time=${SECONDS} -rss_limit_mb=2048 -timeout=40 -max_len=65536
    -artifact_prefix=${BUILD}/ ${BUILD}/corpus ${BUILD}/seeds)
