# Tool chain for wheels that run with any glibc from 2.28 on:
#   scripts/make_wheel_root ROOT
#   cmake ... -DCMAKE_TOOLCHAIN_FILE=cmake/manylinux.cmake -DTWINMILL_WHEEL_ROOT=ROOT
set(TWINMILL_WHEEL_ROOT "" CACHE PATH "Folder that scripts/make_wheel_root made")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES TWINMILL_WHEEL_ROOT)
if(NOT EXISTS "${TWINMILL_WHEEL_ROOT}/target")
    message(FATAL_ERROR "TWINMILL_WHEEL_ROOT='${TWINMILL_WHEEL_ROOT}' is not what "
            "scripts/make_wheel_root makes")
endif()
file(READ "${TWINMILL_WHEEL_ROOT}/target" _target)
string(REGEX MATCH "^[^ ]+" CMAKE_SYSTEM_PROCESSOR "${_target}")
set(CMAKE_SYSTEM_NAME Linux)
set(_usr "${TWINMILL_WHEEL_ROOT}/usr")
set(_library "${CMAKE_SYSTEM_PROCESSOR}-linux-gnu")
set(CMAKE_LIBRARY_ARCHITECTURE "${_library}")
set(CMAKE_C_COMPILER "${_usr}/bin/zig-cc")
set(CMAKE_CXX_COMPILER "${_usr}/bin/zig-c++")
set(CMAKE_AR "${_usr}/bin/zig-ar" CACHE FILEPATH "")
set(CMAKE_RANLIB "${_usr}/bin/zig-ranlib" CACHE FILEPATH "")
# Zig's compiler traps what is undefined unless told otherwise.
set(_flags "-fno-sanitize=undefined -isystem ${_usr}/include -isystem ${_usr}/include/${_library}")
set(CMAKE_C_FLAGS_INIT "${_flags}")
# nanobind relies on a <string> that includes <cstdio>, and that of Zig's C++ library does not.
set(CMAKE_CXX_FLAGS_INIT "${_flags} -include cstdio")
set(_link "-L${_usr}/lib/${_library} -Wl,--allow-shlib-undefined")
set(CMAKE_EXE_LINKER_FLAGS_INIT "${_link}")
set(CMAKE_MODULE_LINKER_FLAGS_INIT "${_link}")
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_FIND_ROOT_PATH "${TWINMILL_WHEEL_ROOT}")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE BOTH) # nanobind is the machine's
set(ENV{PKG_CONFIG_SYSROOT_DIR} "${TWINMILL_WHEEL_ROOT}")
set(ENV{PKG_CONFIG_LIBDIR} "${_usr}/lib/${_library}/pkgconfig:${_usr}/share/pkgconfig")
