# cmake -D CLANGXX=... -D SOURCE=... -D BUILD=... -D NAME=pictures -D FUZZER=picture_fuzzer
#       -D OPTIMIZATION=-O1 -D SECONDS=... -P run_reader_fuzzer.cmake
# Builds one of the fuzzers of readers/ and runs it for a while on the seeds of its name.
include(${CMAKE_CURRENT_LIST_DIR}/run.cmake)

cmake_host_system_information(RESULT processors QUERY NUMBER_OF_LOGICAL_CORES)
run(${CMAKE_COMMAND} -S ${SOURCE}/tests/fuzz/readers -B ${BUILD} -DCMAKE_CXX_COMPILER=${CLANGXX}
    -DDIORAMA_FUZZ_OPTIMIZATION=${OPTIMIZATION})
run(${CMAKE_COMMAND} --build ${BUILD} --parallel ${processors} --target ${FUZZER})
file(MAKE_DIRECTORY ${BUILD}/corpus/${NAME})
run(${BUILD}/${FUZZER} -max_total_time=${SECONDS} -rss_limit_mb=1024 -timeout=10 -max_len=65536
    -artifact_prefix=${BUILD}/${NAME}- ${BUILD}/corpus/${NAME} ${SOURCE}/tests/fuzz/seeds/${NAME})
