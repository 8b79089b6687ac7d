# Tool chain for the robot's arm64 Debian, from any machine with gcc-aarch64-linux-gnu:
#   scripts/make_sysroot SYSROOT trixie       # or bookworm: the Debian of the robot
#   cmake -S . -B build-arm64 -G Ninja -DCMAKE_TOOLCHAIN_FILE=cmake/aarch64.cmake \
#       -DTWINMILL_SYSROOT=SYSROOT -DTWINMILL_BUILD_TWIN=OFF
# With qemu-aarch64-static installed, tests run, too.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_STRIP aarch64-linux-gnu-strip)

set(TWINMILL_SYSROOT "" CACHE PATH "Folder that scripts/make_sysroot made")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES TWINMILL_SYSROOT)
if(NOT IS_DIRECTORY "${TWINMILL_SYSROOT}")
    message(FATAL_ERROR "TWINMILL_SYSROOT='${TWINMILL_SYSROOT}' is no folder: make one with "
            "scripts/make_sysroot")
endif()
set(CMAKE_SYSROOT "${TWINMILL_SYSROOT}")
# The compiler looks at its own headers and libraries for arm64, where they are installed
# (libc6-dev-arm64-cross), before those of a sysroot: of another release, the two do not fit together.
set(CMAKE_C_FLAGS_INIT "-isystem ${TWINMILL_SYSROOT}/usr/include/aarch64-linux-gnu \
-isystem ${TWINMILL_SYSROOT}/usr/include -B${TWINMILL_SYSROOT}/usr/lib/aarch64-linux-gnu/")
set(CMAKE_EXE_LINKER_FLAGS_INIT "-L${TWINMILL_SYSROOT}/usr/lib/aarch64-linux-gnu")
set(CMAKE_FIND_ROOT_PATH "${TWINMILL_SYSROOT}")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static -L "${TWINMILL_SYSROOT}")

# Libraries are looked up in the sysroot alone.
set(ENV{PKG_CONFIG_SYSROOT_DIR} "${TWINMILL_SYSROOT}")
set(ENV{PKG_CONFIG_LIBDIR}
    "${TWINMILL_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${TWINMILL_SYSROOT}/usr/share/pkgconfig")
