# Finds MuJoCo, exactly the version below, and makes the target MuJoCo::MuJoCo.
#
# It is looked for in TWINMILL_MUJOCO_DIR, or else where Python keeps its package `mujoco`
# (pip install mujoco-core). Both hold the headers in include/ and the library beside it or in lib/.
set(_mujoco_version 4.0.1)
set(_mujoco_header_version 4000001)

set(_mujoco_dir "${TWINMILL_MUJOCO_DIR}")
if(NOT _mujoco_dir)
    find_package(Python COMPONENTS Interpreter QUIET)
    execute_process(
        COMMAND "${Python_EXECUTABLE}" -c
                "import importlib.util as u; print(*u.find_spec('mujoco').submodule_search_locations)"
        OUTPUT_VARIABLE _mujoco_dir OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()

find_path(MuJoCo_INCLUDE_DIR mujoco/mujoco.h PATHS "${_mujoco_dir}/include"
          NO_DEFAULT_PATH NO_CMAKE_FIND_ROOT_PATH NO_CACHE)
find_file(MuJoCo_LIBRARY "libmujoco.so.${_mujoco_version}" PATHS "${_mujoco_dir}" "${_mujoco_dir}/lib"
          NO_DEFAULT_PATH NO_CMAKE_FIND_ROOT_PATH NO_CACHE)
if(MuJoCo_INCLUDE_DIR AND MuJoCo_LIBRARY)
    file(STRINGS "${MuJoCo_INCLUDE_DIR}/mujoco/mujoco.h" _mujoco_line REGEX "define mjVERSION_HEADER")
endif()
if(NOT "${_mujoco_line}" MATCHES " ${_mujoco_header_version}$")
    message(FATAL_ERROR
        "MuJoCo ${_mujoco_version} was not found in '${_mujoco_dir}' (the package that "
        "'${Python_EXECUTABLE}' sees, unless TWINMILL_MUJOCO_DIR names another folder): install it with "
        "'pip install mujoco-core==${_mujoco_version}', or set TWINMILL_MUJOCO_DIR.")
endif()

set(MuJoCo_FOUND TRUE)
if(NOT TARGET MuJoCo::MuJoCo)
    add_library(MuJoCo::MuJoCo SHARED IMPORTED)
    set_target_properties(MuJoCo::MuJoCo PROPERTIES
        IMPORTED_LOCATION "${MuJoCo_LIBRARY}"
        INTERFACE_INCLUDE_DIRECTORIES "${MuJoCo_INCLUDE_DIR}")
endif()
