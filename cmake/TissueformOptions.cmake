# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Compiler settings that hold for every target.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
# For executables too, and for targets without threads: one precompiled header serves all.
add_compile_options(-fPIC -pthread)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/bin")

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()

set(TISSUEFORM_SANITIZE "" CACHE STRING
    "Sanitizers for every target: empty, 'address,undefined' or 'thread'")
option(TISSUEFORM_WARNINGS_AS_ERRORS "Treat compiler warnings as errors" ON)
option(TISSUEFORM_FUZZERS "Build the libFuzzer targets (needs clang)" OFF)

add_compile_options(-Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual)
if(TISSUEFORM_WARNINGS_AS_ERRORS)
  add_compile_options(-Werror)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC 12 reports these inside Eigen's and the standard library's inlined code at -O3
  # (GCC bugs 105329, 106247); clang-tidy covers the same defects in ours.
  add_compile_options(-Wno-maybe-uninitialized -Wno-array-bounds -Wno-stringop-overflow
                      -Wno-stringop-overread -Wno-restrict)
endif()

if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  # A precompiled header made anew from the same text stays the same for ccache.
  add_compile_options("SHELL:-Xclang -fno-pch-timestamp")
endif()

# Some 120 programs are linked: in a tenth of the time that GNU's linker takes.
find_program(TISSUEFORM_LLD ld.lld)
if(TISSUEFORM_LLD)
  add_link_options(-fuse-ld=lld)
endif()

if(TISSUEFORM_SANITIZE)
  add_compile_options(-fsanitize=${TISSUEFORM_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${TISSUEFORM_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    # Code asks for a sanitizer by GCC's names.
    if(TISSUEFORM_SANITIZE MATCHES "thread")
      add_compile_definitions(__SANITIZE_THREAD__)
    else()
      add_compile_definitions(__SANITIZE_ADDRESS__)
    endif()
  endif()
  if(TISSUEFORM_SANITIZE MATCHES "undefined")
    add_compile_options(-fno-sanitize-recover=undefined)
    # A seventh of the time of compilation; AddressSanitizer sees more than the second, and the first looks at casts
    # between classes with virtual functions, of which there are none.
    add_compile_options(-fno-sanitize=vptr,object-size)
  endif()
endif()
