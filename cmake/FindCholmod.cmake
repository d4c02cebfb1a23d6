# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# CHOLMOD::CHOLMOD. Debian's SuiteSparse 5 ships no CMake package; OpenBLAS is linked by name because
# its thread count is set per job (core/mechanics/linear_solvers/blas_threads.h) and because the reference BLAS
# that CHOLMOD would otherwise pick up is many times slower.

if(TARGET CHOLMOD::CHOLMOD)
  return()
endif()
find_path(CHOLMOD_INCLUDE_DIR cholmod.h PATH_SUFFIXES suitesparse REQUIRED)
find_library(CHOLMOD_LIBRARY cholmod REQUIRED)
find_path(OPENBLAS_INCLUDE_DIR openblas_config.h
          PATH_SUFFIXES ${CMAKE_LIBRARY_ARCHITECTURE} ${CMAKE_LIBRARY_ARCHITECTURE}/openblas-pthread REQUIRED)
find_library(OPENBLAS_LIBRARY openblas REQUIRED)

add_library(CHOLMOD::CHOLMOD INTERFACE IMPORTED)
target_include_directories(CHOLMOD::CHOLMOD SYSTEM INTERFACE "${CHOLMOD_INCLUDE_DIR}")
# libgomp is GCC's, which CHOLMOD itself uses: its threads are turned off (cholmod_cholesky.cc).
target_link_libraries(CHOLMOD::CHOLMOD INTERFACE "${CHOLMOD_LIBRARY}" "${OPENBLAS_LIBRARY}" gomp)
