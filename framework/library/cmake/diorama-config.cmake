# find_package(diorama [0.1]): target diorama::engine, libdiorama with what it needs of the SDK.
include(CMakeFindDependencyMacro)
# Installed side by side, also where only this package was pointed to.
find_dependency(diorama_sdk ${diorama_VERSION} EXACT HINTS ${CMAKE_CURRENT_LIST_DIR}/../diorama_sdk)
include(${CMAKE_CURRENT_LIST_DIR}/diorama-targets.cmake)
