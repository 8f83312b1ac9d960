# Ten seconds of fuzzing are not worth an optimised build; nights ask for one.
set(optimization -O0)
if(DEFINED ENV{DIORAMA_FUZZER_OPTIMIZATION})
  set(optimization $ENV{DIORAMA_FUZZER_OPTIMIZATION})
endif()

# run(COMMAND...): runs a command; what fails ends the script.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "failed: ${ARGN}")
  endif()
endfunction()
