# Flags of our own targets. Kept out of the installed SDK: a third party brings its own.
add_library(diorama_build_flags INTERFACE)
# No contraction to FMA: the same numbers on every x86-64 machine.
target_compile_options(diorama_build_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow
                                                     -ffp-contract=off)
# GCC 12 sees overlaps and overruns in std::string that are not there (GCC bugs 105651, 105329, 105762).
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  target_compile_options(diorama_build_flags INTERFACE -Wno-restrict -Wno-array-bounds
                                                       -Wno-stringop-overflow -Wno-stringop-overread)
elseif(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # GCC 13 takes a reference that a function returns for one into its temporary arguments (107532).
  target_compile_options(diorama_build_flags INTERFACE -Wno-dangling-reference)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_UNITY_BUILD)
  # A class of one source file looks like one of a header where files are compiled together.
  target_compile_options(diorama_build_flags INTERFACE -Wno-subobject-linkage)
endif()
if(DIORAMA_WARNINGS_AS_ERRORS)
  target_compile_options(diorama_build_flags INTERFACE -Werror)
endif()
if(DIORAMA_SANITIZE)
  target_compile_options(diorama_build_flags INTERFACE -fsanitize=${DIORAMA_SANITIZE}
                                                       -fno-omit-frame-pointer
                                                       -fno-sanitize-recover=all)
  target_link_options(diorama_build_flags INTERFACE -fsanitize=${DIORAMA_SANITIZE})
endif()

# For what nearly all of a job's time is spent in. Compilers need up to ten times as long for it, with sanitizers minutes.
if(DIORAMA_SANITIZE)
  set(DIORAMA_HOT_CODE -O1)
else()
  set(DIORAMA_HOT_CODE $<$<CONFIG:RelWithDebInfo,Release>:-O3>)
endif()
