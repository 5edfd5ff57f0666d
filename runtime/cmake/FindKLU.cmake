# KLU of SuiteSparse with the libraries it stands on, as target KLU::KLU. Distributions install no CMake files for it.
find_path(KLU_INCLUDE_DIR klu.h PATH_SUFFIXES suitesparse)

set(_suitesparse 0)
if(KLU_INCLUDE_DIR AND EXISTS "${KLU_INCLUDE_DIR}/SuiteSparse_config.h")
  file(STRINGS "${KLU_INCLUDE_DIR}/SuiteSparse_config.h" _line REGEX "^#define +SUITESPARSE_MAIN_VERSION +[0-9]+")
  string(REGEX MATCH "[0-9]+$" _suitesparse "${_line}")
endif()

set(KLU_LIBRARIES "")
set(_klu_variables "")
foreach(_name klu amd colamd btf suitesparseconfig)
  set(_names ${_name})
  if(GUSTFORM_STATIC_SOLVERS AND NOT (_name STREQUAL suitesparseconfig AND _suitesparse VERSION_GREATER_EQUAL 7))
    # The static one first; of each name the shared one if there is no other. From SuiteSparse 7 on, the static
    # suitesparseconfig asks for OpenMP; before, its data must not lie in another library.
    set(_names lib${_name}.a ${_name})
  endif()
  find_library(KLU_${_name}_LIBRARY NAMES ${_names})
  list(APPEND KLU_LIBRARIES "${KLU_${_name}_LIBRARY}")
  list(APPEND _klu_variables KLU_${_name}_LIBRARY)
endforeach()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(
  KLU
  REQUIRED_VARS KLU_INCLUDE_DIR ${_klu_variables}
  REASON_FAILURE_MESSAGE "install SuiteSparse (Debian, Ubuntu: apt-get install libsuitesparse-dev)")

if(KLU_FOUND AND NOT TARGET KLU::KLU)
  add_library(KLU::KLU INTERFACE IMPORTED)
  set_target_properties(KLU::KLU PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${KLU_INCLUDE_DIR}"
                                            INTERFACE_LINK_LIBRARIES "${KLU_LIBRARIES};m")
endif()
mark_as_advanced(KLU_INCLUDE_DIR ${_klu_variables})
