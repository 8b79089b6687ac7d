# Settings shared by all targets, and the few functions that make them.

set(CMAKE_C_STANDARD 11)
set(CMAKE_C_EXTENSIONS OFF)
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/bin")
if(NOT CMAKE_BUILD_TYPE)
    set(CMAKE_BUILD_TYPE Release)
endif()

# Same bits on every machine: no fused multiply-add that one compiler makes and another does not.
add_compile_options(-ffp-contract=off)
# Calls within a file may be inlined, although the code may go into a shared library.
add_compile_options(-fno-semantic-interposition)
# A finding ends the program, so that its test fails.
if(TWINMILL_SANITIZE OR TWINMILL_FUZZ)
    add_compile_options(
        -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer)
    add_link_options(-fsanitize=address,undefined)
endif()
if(TWINMILL_FUZZ)
    add_compile_options(-fsanitize=fuzzer-no-link)
endif()

# Warnings are errors in our own code; another project's compiler may know more warnings.
function(twinmill_strict target)
    target_compile_options(${target} PRIVATE
        -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wswitch
        $<$<AND:$<BOOL:${PROJECT_IS_TOP_LEVEL}>,$<NOT:$<BOOL:${SKBUILD}>>>:-Werror>
        $<$<COMPILE_LANGUAGE:C>:-Wstrict-prototypes -Wmissing-prototypes>)
endfunction()

# twinmill_library(name SOURCES ... DEPENDS ...): one static library per folder. Other folders reach
# its headers as <folder>/<header>.h through the repository's layer root, and only if they link it.
function(twinmill_library target)
    cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
    add_library(${target} STATIC ${ARG_SOURCES})
    target_include_directories(${target} PUBLIC
        "$<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>"
        "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/twinmill>")
    target_link_libraries(${target} PUBLIC ${ARG_DEPENDS})
    twinmill_strict(${target})
endfunction()

# What makes a fault in a program that listens on a network harder to use; what it never uses, tables
# for exceptions among it, is left out. The sanitizers have checks of their own.
function(twinmill_harden target)
    if(TWINMILL_SANITIZE OR TWINMILL_FUZZ)
        return()
    endif()
    target_compile_options(${target} PRIVATE
        -fstack-protector-strong -fstack-clash-protection -ffunction-sections -fdata-sections
        -fno-unwind-tables -fno-asynchronous-unwind-tables
        $<$<NOT:$<CONFIG:Debug>>:-U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=3>)
    if(CMAKE_SYSTEM_PROCESSOR STREQUAL "aarch64")
        # Whole-program optimisation, for size. No Pi's processor knows branch protection.
        set_target_properties(${target} PROPERTIES INTERPROCEDURAL_OPTIMIZATION ON)
        target_compile_options(${target} PRIVATE -mno-outline-atomics)
    endif()
    get_target_property(type ${target} TYPE)
    if(type STREQUAL "EXECUTABLE")
        target_link_options(${target} PRIVATE
            -pie -Wl,-z,relro,-z,now,-z,noexecstack,--gc-sections,--as-needed,--no-eh-frame-hdr)
    endif()
endfunction()
