include(${CMAKE_CURRENT_LIST_DIR}/steps.cmake)
set(project ${WORK}/new/my_${KIND})
file(REMOVE_RECURSE ${project} ${project}_build)
run(${DIORAMA} new-plugin ${KIND} my_${KIND} --dir ${project} --licence MIT)
expect_text("cmake -S ${project} -B ${project}/build")

foreach(file CMakeLists.txt README.md LICENSE .gitignore job.yaml src/my_${KIND}.cpp
             tests/my_${KIND}_test.cpp tests/plugin_under_test.h)
  file(READ ${project}/${file} text)
  if(text MATCHES "@[A-Z]+@")
    message(FATAL_ERROR "${file} holds ${CMAKE_MATCH_0}")
  endif()
endforeach()
build_and_list(${project} ${project}_build my_${KIND})

# Tools that go by clang see what the compiler sees.
find_program(CLANG_TIDY NAMES clang-tidy clang-tidy-19)
if(CLANG_TIDY)
  run(${CLANG_TIDY} -p ${project}_build --quiet
      --checks=-*,clang-diagnostic-*,bugprone-use-after-move,modernize-use-override
      --warnings-as-errors=* ${project}/src/my_${KIND}.cpp)
endif()

# The job is a good one: its keys, and those of the plugin.
run(${DIORAMA} --plugin-dir ${project}_build/plugins run --plan ${project}/job.yaml)

run_refused("expected a new or empty folder" ${DIORAMA} new-plugin ${KIND} again --dir ${project})
run_refused("there is no kind '${KIND}x', did you mean '${KIND}'?" ${DIORAMA} new-plugin ${KIND}x a)
run_refused("such as my_boxes, found 'My-Boxes'" ${DIORAMA} new-plugin ${KIND} My-Boxes)
run_refused("the name 'test' is taken by CMake" ${DIORAMA} new-plugin ${KIND} test)
run_refused("there is no text of the licence 'WTF'; there are: Apache-2.0, BSD-3-Clause, MIT"
            ${DIORAMA} new-plugin ${KIND} a --licence WTF)
