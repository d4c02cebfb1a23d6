# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# What `cmake --install` makes of a build:
#
#   bin/                          what users start
#   libexec/tissueform/           what those start, and the modules that they load
#   lib/, include/tissueform/     the client library with all that it links; includes are written as in the repository
#   lib/cmake/tissueform/         find_package(tissueform): tissueform::client_cpp
#   share/tissueform/             bundled plans, .proto files, schemas, the planner for browsers
#   share/doc/tissueform/         an example, the licence
#   share/man/man1/               manual pages, made from --help
#
# The tree may be moved: nothing in it knows the source or the build folder, and programs find each other and their
# data by where they lie themselves.

include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME tissueform)
set(TISSUEFORM_INSTALL_INCLUDE "${CMAKE_INSTALL_INCLUDEDIR}/tissueform")
set(TISSUEFORM_INSTALL_CMAKE "${CMAKE_INSTALL_LIBDIR}/cmake/tissueform")
set(TISSUEFORM_INSTALL_LIBEXEC "${CMAKE_INSTALL_LIBEXECDIR}/tissueform")
set(TISSUEFORM_INSTALL_DATA "${CMAKE_INSTALL_DATADIR}/tissueform")

# tissueform_install_program(TARGET bin|libexec): a program, or a module that programs there load. What runs as a
# service is a component of its own (`cmake --install BUILD --component server`): a machine that serves wants nothing else.
# The client library is the component client_cpp (deploy/build_client_library.sh).
function(tissueform_install_program target where)
  set(component tissueform)
  if(target STREQUAL "tissueform-server")
    set(component server)
  elseif(target STREQUAL "tissueform-gateway")
    set(component gateway)
  elseif(target STREQUAL "tissueform-pacs")
    set(component pacs)
  endif()
  if(where STREQUAL "bin")
    set(folder "${CMAKE_INSTALL_BINDIR}")
  elseif(where STREQUAL "libexec")
    set(folder "${TISSUEFORM_INSTALL_LIBEXEC}")
  else()
    message(FATAL_ERROR "${target}: installed into bin or libexec, not ${where}")
  endif()
  install(TARGETS ${target} RUNTIME DESTINATION "${folder}" COMPONENT ${component}
          LIBRARY DESTINATION "${folder}" COMPONENT ${component})
endfunction()

# All of ours that a library links, and all others, privately too: a static library's user links them.
function(_tissueform_link_closure out_ours out_others)
  set(waiting ${ARGN})
  set(ours)
  set(others)
  while(waiting)
    list(POP_FRONT waiting library)
    string(REGEX REPLACE "^\\$<LINK_ONLY:(.*)>$" "\\1" library "${library}")
    if(NOT library MATCHES "^tissueform::")
      list(APPEND others ${library})
      continue()
    endif()
    get_target_property(target ${library} ALIASED_TARGET)
    if(NOT target IN_LIST ours)
      list(APPEND ours ${target})
      get_target_property(links ${target} INTERFACE_LINK_LIBRARIES)
      if(links)  # a library may have none
        list(APPEND waiting ${links})
      endif()
    endif()
  endwhile()
  list(REMOVE_DUPLICATES others)
  set(${out_ours} ${ours} PARENT_SCOPE)
  set(${out_others} ${others} PARENT_SCOPE)
endfunction()

# Which package gives a library. A new one must be named here, or those who link us could not find it.
function(_tissueform_dependencies out)
  set(lines)
  foreach(library IN LISTS ARGN)
    if(library MATCHES "^absl::")
      list(APPEND lines "find_dependency(absl CONFIG)")
    elseif(library MATCHES "^Eigen3::")
      list(APPEND lines "find_dependency(Eigen3 3.4 CONFIG)")
    elseif(library MATCHES "^gRPC::")
      list(APPEND lines "find_dependency(Protobuf)" "find_dependency(gRPC CONFIG)")
    elseif(library MATCHES "^protobuf::")
      list(APPEND lines "find_dependency(Protobuf)")
    elseif(library MATCHES "^OpenSSL::")
      list(APPEND lines "find_dependency(OpenSSL COMPONENTS Crypto)")
    elseif(library MATCHES "^zstd::")
      list(APPEND lines "find_dependency(zstd CONFIG)")
    elseif(library MATCHES "^Threads::")
      list(APPEND lines "find_dependency(Threads)")
    elseif(library MATCHES "^nlohmann_json::")
      list(APPEND lines "find_dependency(nlohmann_json CONFIG)")
    elseif(library MATCHES "^CHOLMOD::")
      list(APPEND lines "include(\"\${CMAKE_CURRENT_LIST_DIR}/FindCholmod.cmake\")")
    else()
      message(FATAL_ERROR "the client library links ${library}: say in cmake/TissueformInstall.cmake where that is found")
    endif()
  endforeach()
  list(REMOVE_DUPLICATES lines)
  list(JOIN lines "\n" lines)
  set(${out} "${lines}" PARENT_SCOPE)
endfunction()

# tissueform_install_library(client_cpp): that library with all it links, their headers, and the package's files. Called
# once, when all targets are known; follows the link interface.
function(tissueform_install_library name)
  _tissueform_link_closure(libraries others tissueform::${name})
  foreach(target IN LISTS libraries)
    string(REGEX REPLACE "^tissueform_" "" exported ${target})
    get_target_property(type ${target} TYPE)
    if(type STREQUAL "INTERFACE_LIBRARY")
      set(scope INTERFACE)
    else()
      set(scope PUBLIC)
    endif()
    target_include_directories(${target} ${scope} "$<INSTALL_INTERFACE:${TISSUEFORM_INSTALL_INCLUDE}>")
    target_compile_features(${target} ${scope} cxx_std_20)
    set_target_properties(${target} PROPERTIES EXPORT_NAME ${exported})
    get_target_property(folder ${target} SOURCE_DIR)
    file(RELATIVE_PATH folder "${PROJECT_SOURCE_DIR}" "${folder}")
    file(GLOB headers CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/${folder}/*.h")
    install(FILES ${headers} DESTINATION "${TISSUEFORM_INSTALL_INCLUDE}/${folder}" COMPONENT client_cpp)
  endforeach()
  install(TARGETS ${libraries} EXPORT tissueform-targets ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT client_cpp)
  install(EXPORT tissueform-targets NAMESPACE tissueform:: DESTINATION "${TISSUEFORM_INSTALL_CMAKE}" COMPONENT client_cpp)
  _tissueform_dependencies(TISSUEFORM_DEPENDENCIES ${others})
  configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/tissueform-config.cmake.in"
    "${PROJECT_BINARY_DIR}/tissueform-config.cmake" INSTALL_DESTINATION "${TISSUEFORM_INSTALL_CMAKE}"
    NO_SET_AND_CHECK_MACRO)
  write_basic_package_version_file("${PROJECT_BINARY_DIR}/tissueform-config-version.cmake"
    COMPATIBILITY SameMinorVersion)
  install(FILES "${PROJECT_BINARY_DIR}/tissueform-config.cmake" "${PROJECT_BINARY_DIR}/tissueform-config-version.cmake"
                "${PROJECT_SOURCE_DIR}/cmake/FindCholmod.cmake"
          DESTINATION "${TISSUEFORM_INSTALL_CMAKE}" COMPONENT client_cpp)
endfunction()

# Programs of the build folder find the data as installed ones do, by a link in its place.
function(tissueform_install_data)
  file(MAKE_DIRECTORY "${PROJECT_BINARY_DIR}/share/tissueform")
  file(CREATE_LINK "${PROJECT_SOURCE_DIR}/tests/data/plans" "${PROJECT_BINARY_DIR}/share/tissueform/plans" SYMBOLIC)
  file(CREATE_LINK "${PROJECT_SOURCE_DIR}/build/web" "${PROJECT_BINARY_DIR}/share/tissueform/web" SYMBOLIC)
  # Where deploy/build_web.sh has built it.
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/build/web" DESTINATION "${TISSUEFORM_INSTALL_DATA}" COMPONENT gateway OPTIONAL)
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/tests/data/plans" DESTINATION "${TISSUEFORM_INSTALL_DATA}")
  install(FILES "${PROJECT_SOURCE_DIR}/docs/plan.schema.json" "${PROJECT_SOURCE_DIR}/docs/recipe.schema.json"
                "${PROJECT_SOURCE_DIR}/docs/targets.schema.json" "${PROJECT_SOURCE_DIR}/docs/case.schema.json" "${PROJECT_SOURCE_DIR}/docs/viewer.schema.json" "${PROJECT_SOURCE_DIR}/docs/series-rules.schema.json"
                "${PROJECT_SOURCE_DIR}/docs/surfaces.schema.json" "${PROJECT_SOURCE_DIR}/docs/outcome.schema.json" "${PROJECT_SOURCE_DIR}/docs/cohort.schema.json" "${PROJECT_SOURCE_DIR}/docs/deviations.schema.json"
          DESTINATION "${TISSUEFORM_INSTALL_DATA}")
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/proto/tissueform" DESTINATION "${TISSUEFORM_INSTALL_DATA}/proto"
          FILES_MATCHING PATTERN "*.proto" PATTERN "store" EXCLUDE)  # what a server keeps for itself is no interface
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/docs/examples" DESTINATION "${CMAKE_INSTALL_DOCDIR}")
  install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DOCDIR}")
endfunction()

# Manual pages, of all targets that the whole build makes. Not under sanitizers, where starting a program takes long.
function(tissueform_install_man_pages)
  find_program(HELP2MAN help2man)
  if(NOT HELP2MAN OR TISSUEFORM_SANITIZE)
    message(STATUS "no manual pages: they need help2man and a build without sanitizers")
    return()
  endif()
  set(folder "${PROJECT_BINARY_DIR}/man")
  set(script "${PROJECT_SOURCE_DIR}/deploy/make_man_pages.sh")
  add_custom_command(OUTPUT "${folder}/made"
    COMMAND bash "${script}" "${CMAKE_RUNTIME_OUTPUT_DIRECTORY}" "${folder}" "${PROJECT_VERSION}"
    COMMAND "${CMAKE_COMMAND}" -E touch "${folder}/made"
    DEPENDS "${script}" ${ARGN} COMMENT "Manual pages" VERBATIM)
  add_custom_target(tissueform-man ALL DEPENDS "${folder}/made")
  install(DIRECTORY "${folder}/" DESTINATION "${CMAKE_INSTALL_MANDIR}/man1" FILES_MATCHING PATTERN "*.1")
endfunction()
