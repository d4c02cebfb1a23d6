# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Where ccache is installed, it compiles: a second build folder, a second checkout and the next run of .ci/run take from
# it what has not changed. Its settings are given here and not left to each user:
#   BASEDIR     paths below the source tree are hashed as relative ones: another checkout finds them
#   NOHASHDIR   nor does the folder of the build count, which debug information names
#   SLOPPINESS  what ccache asks for with precompiled headers; we use no __DATE__ or __TIME__
# Two checkouts share objects because no path of theirs is a macro (tests/testing/test_paths.h) and because the
# precompiled headers are included by their relative names: ccache hands out the same .gch to both then, and all that
# was compiled with it.
option(TISSUEFORM_CCACHE "Compile with ccache where it is installed" ON)

# A launcher that was chosen stays, with its own settings.
if(TISSUEFORM_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  find_program(CCACHE_PROGRAM ccache)
  if(CCACHE_PROGRAM)
    set(CMAKE_CXX_COMPILER_LAUNCHER env "CCACHE_BASEDIR=${PROJECT_SOURCE_DIR}" CCACHE_NOHASHDIR=1
        CCACHE_SLOPPINESS=pch_defines,time_macros "${CCACHE_PROGRAM}")
    set(TISSUEFORM_SHARES_OBJECTS ON)
  endif()
endif()
