include(${CMAKE_CURRENT_LIST_DIR}/steps.cmake)
file(REMOVE_RECURSE ${WORK})
# Everything inside must be found relative to the prefix: it is moved after the installation.
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/installed)
file(RENAME ${WORK}/installed ${PREFIX})

foreach(file IN ITEMS
    include/diorama/scene.h ${LIBDIR}/libdiorama_sdk.so ${LIBDIR}/libdiorama_sdk.so.${ABI}
    ${LIBDIR}/libdiorama_sdk.so.${VERSION} ${LIBDIR}/cmake/diorama_sdk/diorama_sdk-config.cmake
    ${DOCDIR}/LICENSE include/diorama/headers_digest.h
    include/diorama/engine.h include/diorama/engine_digest.h ${LIBDIR}/libdiorama.so ${LIBDIR}/libdiorama.so.${ABI}
    ${LIBDIR}/libdiorama.so.${VERSION} ${LIBDIR}/cmake/diorama/diorama-config.cmake ${LIBDIR}/pkgconfig/diorama.pc
    ${LIBDIR}/pkgconfig/diorama_sdk.pc share/diorama/templates/common/CMakeLists.txt
    share/man/man1/diorama.1 share/man/man5/diorama-job.5 share/bash-completion/completions/diorama
    share/zsh/vendor-completions/_diorama share/fish/vendor_completions.d/diorama.fish)
  if(NOT EXISTS ${PREFIX}/${file})
    message(FATAL_ERROR "${file} was not installed")
  endif()
endforeach()

# No installed text file may know where it was built or installed.
file(GLOB_RECURSE texts ${PREFIX}/*.cmake ${PREFIX}/*.pc ${PREFIX}/*.h)
foreach(file IN LISTS texts)
  file(READ ${file} text)
  foreach(place ${WORK} ${BUILD} ${REPOSITORY})
    string(FIND "${text}" "${place}" at)
    if(NOT at EQUAL -1)
      message(FATAL_ERROR "${file} names ${place}")
    endif()
  endforeach()
endforeach()
run(${DIORAMA} --version)
expect_text("diorama ${VERSION} (plugin ABI ${ABI})")

# Completion knows every option that the help shows.
file(WRITE ${WORK}/offer.sh
     "source ${PREFIX}/share/bash-completion/completions/diorama
COMP_WORDS=(diorama run --)
COMP_CWORD=2
_diorama
echo \"\${COMPREPLY[*]}\"\n")
run(bash ${WORK}/offer.sh)
set(offered "${OUT}")
run(${DIORAMA} run --help)
string(REGEX MATCHALL "--[a-z-]+" options "${OUT}")
foreach(option IN LISTS options)
  if(NOT offered MATCHES "${option}( |\n)")
    message(FATAL_ERROR "completion lacks ${option}; it offers ${offered}")
  endif()
endforeach()
