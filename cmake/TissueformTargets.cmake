# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# One target a folder. Includes are written from the repository root.

# Precompiled headers: most of a compilation is reading Eigen, Abseil and GoogleTest again. Five of them serve all
# targets; every target is compiled with the same options (-fPIC, executables too) so that they fit.
option(TISSUEFORM_PRECOMPILED_HEADERS "Precompile the large headers" ON)

# Only what computes is compiled with -O3 in Release: the folders of `numeric`. The rest starts, reads, writes and waits; there
# -O1 is as fast and compiles in two thirds of the time. A precompiled header needs the same options as its users.
set(_tissueform_numeric "^core/(base|mesh|mechanics|imaging)(/|$)")
set(_tissueform_quick_options $<$<CONFIG:Release>:-O1>)

function(_tissueform_precompiled name)
  set(target tissueform_precompiled_${name})
  add_library(${target} OBJECT "${PROJECT_SOURCE_DIR}/cmake/precompiled/none.cc")
  target_include_directories(${target} PRIVATE "${PROJECT_SOURCE_DIR}")
  target_link_libraries(${target} PRIVATE Eigen3::Eigen absl::statusor absl::str_format Threads::Threads ${ARGN})
  set(file ${name})
  if(name STREQUAL "numeric")
    set(file library)
  endif()
  set(header "${PROJECT_SOURCE_DIR}/cmake/precompiled/${file}.h")
  if(TISSUEFORM_SHARES_OBJECTS)
    set(header "<cmake/precompiled/${file}.h>")  # a name without the checkout's path: see CompilerCache.cmake
  endif()
  target_precompile_headers(${target} PRIVATE "${header}")
  if(NOT name STREQUAL "numeric")
    target_compile_options(${target} PRIVATE ${_tissueform_quick_options})
  endif()
endfunction()

# Called once, when the packages are found.
function(tissueform_precompile_headers)
  if(TISSUEFORM_PRECOMPILED_HEADERS)
    _tissueform_precompiled(numeric)
    _tissueform_precompiled(library)
    _tissueform_precompiled(command CLI11::CLI11 nlohmann_json::nlohmann_json)
    _tissueform_precompiled(rpc gRPC::grpc++ protobuf::libprotobuf)
    if(BUILD_TESTING)
      _tissueform_precompiled(test GTest::gmock)
      _tissueform_precompiled(rpc_test GTest::gmock gRPC::grpc++ protobuf::libprotobuf)
    endif()
  endif()
endfunction()

function(_tissueform_use_precompiled target name)
  if(NOT name STREQUAL "numeric")
    target_compile_options(${target} PRIVATE ${_tissueform_quick_options})
  endif()
  if(TARGET tissueform_precompiled_${name})
    target_precompile_headers(${target} REUSE_FROM tissueform_precompiled_${name})
  endif()
endfunction()

# Unity builds put some files together, so that what they include is read, and what they instantiate made, once. Which files
# may be together, source_names.py says. `dev` is built without: there a missing include shall be seen.
option(TISSUEFORM_TOGETHER "Compile up to eight files of a target at once" ON)
set(_tissueform_most_together 8)
if(TISSUEFORM_TOGETHER)
  set(CMAKE_UNITY_BUILD ON)
  find_package(Python3 3.11 REQUIRED COMPONENTS Interpreter)
  # GCC takes the file that is compiled for the one that a class belongs to.
  add_compile_options($<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()

function(_tissueform_put_together target)
  get_target_property(together ${target} UNITY_BUILD)
  if(NOT together)
    return()
  endif()
  execute_process(
    COMMAND "${Python3_EXECUTABLE}" "${PROJECT_SOURCE_DIR}/cmake/source_names.py" ${_tissueform_most_together} ${ARGN}
    WORKING_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" OUTPUT_VARIABLE numbers OUTPUT_STRIP_TRAILING_WHITESPACE
    COMMAND_ERROR_IS_FATAL ANY)
  string(REPLACE "\n" ";" numbers "${numbers}")
  foreach(source number IN ZIP_LISTS ARGN numbers)
    if(number EQUAL -1)
      set_source_files_properties("${source}" PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    else()
      set_source_files_properties("${source}" PROPERTIES UNITY_GROUP "${number}")
    endif()
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD_MODE GROUP)
endfunction()

# tissueform_library(core_mesh SOURCES a.cc b.cc DEPS core_base absl::status)
#
# A static library tissueform_core_mesh with alias tissueform::core_mesh. DEPS are public; names
# without :: are folders of this project. PRECOMPILED command: the files read options or JSON; rpc: they speak gRPC.
function(tissueform_library name)
  cmake_parse_arguments(ARG "" "PRECOMPILED" "SOURCES;DEPS;PRIVATE_DEPS" ${ARGN})
  if(NOT ARG_PRECOMPILED)
    set(ARG_PRECOMPILED library)
    file(RELATIVE_PATH folder "${PROJECT_SOURCE_DIR}" "${CMAKE_CURRENT_SOURCE_DIR}")
    if(folder MATCHES "${_tissueform_numeric}")
      set(ARG_PRECOMPILED numeric)
    endif()
  endif()
  set(target tissueform_${name})
  if(ARG_SOURCES)
    add_library(${target} STATIC ${ARG_SOURCES})
    _tissueform_put_together(${target} ${ARG_SOURCES})
    _tissueform_use_precompiled(${target} ${ARG_PRECOMPILED})
    set(scope PUBLIC)
  else()
    add_library(${target} INTERFACE)
    set(scope INTERFACE)
  endif()
  add_library(tissueform::${name} ALIAS ${target})
  target_include_directories(${target} ${scope} "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>")
  _tissueform_resolve(deps ${ARG_DEPS})
  target_link_libraries(${target} ${scope} ${deps})
  if(ARG_PRIVATE_DEPS)
    _tissueform_resolve(private_deps ${ARG_PRIVATE_DEPS})
    target_link_libraries(${target} PRIVATE ${private_deps})
  endif()
endfunction()

# tissueform_binary(tissueform INSTALL bin SOURCES main.cc DEPS client_cli_shared)
#
# INSTALL bin: users start it; otherwise other programs of ours do (libexec), and find it by FindProgram of core/base/process.
# Programs of tests/ and of client/lab/ are not installed. The target `programs` builds all of them.
add_custom_target(programs)
function(tissueform_binary name)
  cmake_parse_arguments(ARG "" "PRECOMPILED;INSTALL" "SOURCES;DEPS" ${ARGN})
  if(NOT ARG_PRECOMPILED)
    set(ARG_PRECOMPILED library)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  add_dependencies(programs ${name})
  _tissueform_put_together(${name} ${ARG_SOURCES})
  _tissueform_use_precompiled(${name} ${ARG_PRECOMPILED})
  _tissueform_resolve(deps ${ARG_DEPS})
  target_link_libraries(${name} PRIVATE ${deps})
  file(RELATIVE_PATH folder "${PROJECT_SOURCE_DIR}" "${CMAKE_CURRENT_SOURCE_DIR}")
  if(ARG_INSTALL)
    tissueform_install_program(${name} ${ARG_INSTALL})
  elseif(NOT folder MATCHES "^(tests|client/lab)/")
    tissueform_install_program(${name} libexec)
  endif()
endfunction()

# tissueform_helper(tissueform-mesh-reader SOURCES main.cc DEPS core_base_process)
#
# A program that only programs of ours start (core/base/process/helper_call.h). Who calls it needs it at run time:
# add_dependencies(LIBRARY HELPER), so the helper must not link that library. It links what it uses and no more,
# because loading shared libraries is most of what a call costs.
function(tissueform_helper name)
  tissueform_binary(${name} INSTALL libexec ${ARGN})
  target_link_options(${name} PRIVATE -Wl,--as-needed)
endfunction()

# tissueform_test(core_mesh SOURCES tet_mesh_test.cc DEPS core_mesh LABELS server SHARDS 4)
#
# One test program a folder, named core_mesh_test, and one entry of ctest, core_mesh: what the tests of a suite share is made
# once, and a program starts once. SHARDS n: n entries core_mesh.1 to core_mesh.n, each with a part of the tests, for programs
# that would otherwise end last. Results with the time of each test: test_results/NAME.xml in the build folder.
# The targets tests-server and tests-inputs build the programs with these labels: the server; what reads from outside. Tests
# with the label `full` are left to .ci/full; the line before them gives the reason. FIXTURE: what ctest makes before
# (tests/client/web).
#
# WRAPPER PROGRAM ARGUMENTS: that program starts the test program and makes what its tests need. Where it is not installed,
# the test program runs without it and skips those tests.
function(tissueform_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT;PRECOMPILED;FIXTURE;SHARDS" "SOURCES;DEPS;LABELS;WRAPPER" ${ARGN})
  if(NOT ARG_PRECOMPILED)
    set(ARG_PRECOMPILED test)
  endif()
  set(target ${name}_test)
  add_executable(${target} ${ARG_SOURCES})
  _tissueform_put_together(${target} ${ARG_SOURCES})
  _tissueform_use_precompiled(${target} ${ARG_PRECOMPILED})
  _tissueform_resolve(deps ${ARG_DEPS})
  target_link_libraries(${target} PRIVATE ${deps} GTest::gmock GTest::gtest_main)
  target_include_directories(${target} PRIVATE "${PROJECT_SOURCE_DIR}")
  if(TISSUEFORM_SANITIZE MATCHES "thread")
    set(mutex "${PROJECT_SOURCE_DIR}/tests/testing/absl_mutex_for_tsan.cc")
    target_sources(${target} PRIVATE "${mutex}")
    target_link_libraries(${target} PRIVATE absl::synchronization)
    set_source_files_properties("${mutex}" PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON SKIP_PRECOMPILE_HEADERS ON)
  endif()
  foreach(label IN LISTS ARG_LABELS)
    if(NOT TARGET tests-${label})
      add_custom_target(tests-${label})
    endif()
    add_dependencies(tests-${label} ${target})
  endforeach()
  if(ARG_SHARDS)
    foreach(shard RANGE 1 ${ARG_SHARDS})
      math(EXPR index "${shard} - 1")
      _tissueform_add_test(${name}.${shard} ${target} "GTEST_TOTAL_SHARDS=set:${ARG_SHARDS};GTEST_SHARD_INDEX=set:${index}")
    endforeach()
  else()
    _tissueform_add_test(${name} ${target} "")
  endif()
endfunction()

# One entry of ctest; reads the arguments of tissueform_test. Scratch files are in the build folder, so that two builds may run
# their tests at the same time. Paths come at run time and not as macros, so that two checkouts compile the same
# (tests/testing/test_paths.h).
function(_tissueform_add_test entry target environment)
  set(command "$<TARGET_FILE:${target}>")
  set(program "")
  if(ARG_WRAPPER)
    list(POP_FRONT ARG_WRAPPER program)
    find_program(TISSUEFORM_${program} ${program})
    if(TISSUEFORM_${program})
      set(command "${TISSUEFORM_${program}}" ${ARG_WRAPPER} "${command}")
    endif()
  endif()
  set(scratch "${PROJECT_BINARY_DIR}/test_scratch")
  file(MAKE_DIRECTORY "${scratch}")
  add_test(NAME ${entry} COMMAND ${command} "--gtest_output=xml:${PROJECT_BINARY_DIR}/test_results/${entry}.xml")
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 900)
  endif()
  set_tests_properties(${entry} PROPERTIES TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}" FIXTURES_REQUIRED "${ARG_FIXTURE}"
    ENVIRONMENT_MODIFICATION "TEST_TMPDIR=set:${scratch}/;TISSUEFORM_SOURCE_DIR=set:${PROJECT_SOURCE_DIR};${environment}")
  if(program)
    # Two of pg_virtualenv that start at the same time take the same port.
    set_tests_properties(${entry} PROPERTIES RESOURCE_LOCK ${program})
  endif()
endfunction()

function(_tissueform_resolve out)
  set(result)
  foreach(dep IN LISTS ARGN)
    if(dep MATCHES "^(core|proto|server|client|tests)_" AND NOT dep MATCHES "::")
      list(APPEND result tissueform::${dep})
    else()
      list(APPEND result ${dep})
    endif()
  endforeach()
  set(${out} ${result} PARENT_SCOPE)
endfunction()
