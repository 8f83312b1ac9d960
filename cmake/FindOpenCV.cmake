# find_package(OpenCV 4.6 REQUIRED COMPONENTS core imgproc ...): targets opencv_core, opencv_imgproc ...
#
# Searches for headers and libraries itself: OpenCV's own CMake package wants every module installed,
# distributions ship a -dev package per module.
find_path(OpenCV_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4)
# Debian keeps opencv_modules.hpp in the folder of the architecture.
find_path(OpenCV_CONFIG_INCLUDE_DIR opencv2/opencv_modules.hpp HINTS ${OpenCV_INCLUDE_DIR}
          PATH_SUFFIXES opencv4)
if(OpenCV_INCLUDE_DIR AND EXISTS ${OpenCV_INCLUDE_DIR}/opencv2/core/version.hpp)
  file(STRINGS ${OpenCV_INCLUDE_DIR}/opencv2/core/version.hpp version_lines
       REGEX "#define CV_VERSION_(MAJOR|MINOR|REVISION) ")
  string(REGEX MATCHALL "[0-9]+" version_numbers "${version_lines}")
  list(JOIN version_numbers "." OpenCV_VERSION)
endif()
foreach(component IN LISTS OpenCV_FIND_COMPONENTS)
  find_library(OpenCV_${component}_LIBRARY opencv_${component})
  if(OpenCV_${component}_LIBRARY AND EXISTS ${OpenCV_INCLUDE_DIR}/opencv2/${component}.hpp)
    set(OpenCV_${component}_FOUND TRUE)
  endif()
endforeach()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(
  OpenCV REQUIRED_VARS OpenCV_INCLUDE_DIR OpenCV_CONFIG_INCLUDE_DIR VERSION_VAR OpenCV_VERSION
  HANDLE_COMPONENTS)
mark_as_advanced(OpenCV_INCLUDE_DIR OpenCV_CONFIG_INCLUDE_DIR)

if(OpenCV_FOUND)
  foreach(component IN LISTS OpenCV_FIND_COMPONENTS)
    mark_as_advanced(OpenCV_${component}_LIBRARY)
    if(NOT TARGET opencv_${component})
      add_library(opencv_${component} UNKNOWN IMPORTED GLOBAL)
      set_target_properties(
        opencv_${component}
        PROPERTIES IMPORTED_LOCATION ${OpenCV_${component}_LIBRARY}
                   INTERFACE_INCLUDE_DIRECTORIES
                   "${OpenCV_INCLUDE_DIR};${OpenCV_CONFIG_INCLUDE_DIR}")
    endif()
  endforeach()
endif()
