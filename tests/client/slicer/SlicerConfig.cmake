# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# A stand-in for 3D Slicer's build tree: reads the module's CMake files, and fails where they do not name all of its files.

foreach(needed IN ITEMS HOMEPAGE CONTRIBUTORS DESCRIPTION ICONURL SCREENSHOTURLS DEPENDS LICENSE_FILE)
  if(NOT EXTENSION_${needed})
    message(FATAL_ERROR "EXTENSION_${needed} is not set")
  endif()
endforeach()
file(WRITE "${CMAKE_BINARY_DIR}/nothing.cmake" "")
set(Slicer_USE_FILE "${CMAKE_BINARY_DIR}/nothing.cmake")
set(Slicer_EXTENSION_GENERATE_CONFIG "${Slicer_USE_FILE}")
set(Slicer_EXTENSION_CPACK "${Slicer_USE_FILE}")

function(slicerMacroBuildScriptedModule)
  cmake_parse_arguments(MODULE "WITH_GENERIC_TESTS" "NAME" "SCRIPTS;RESOURCES" ${ARGN})
  file(GLOB_RECURSE found RELATIVE "${CMAKE_CURRENT_SOURCE_DIR}" "*.py" "Resources/*")
  set(named ${MODULE_SCRIPTS} ${MODULE_RESOURCES})
  list(SORT found)
  list(SORT named)
  if(NOT found STREQUAL named)
    message(FATAL_ERROR "the module has ${found}, but its CMakeLists.txt names ${named}")
  endif()
endfunction()
