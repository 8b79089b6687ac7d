# What other projects build on. `cmake --install build --prefix X` puts it below X, for
# find_package(twinmill) and, the core alone, for pkg-config.
include(CMakePackageConfigHelpers)
set(package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/twinmill")

# twinmill_install(name target ...): the targets and their headers, the first as twinmill::<name>, as
# the component `name` of the package.
function(twinmill_install name target)
    set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
    add_library(twinmill::${name} ALIAS ${target})
    install(TARGETS ${target} ${ARGN} EXPORT twinmill-${name}
        ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT ${name})
    install(EXPORT twinmill-${name} NAMESPACE twinmill:: DESTINATION "${package_dir}" COMPONENT ${name})
    foreach(library ${target} ${ARGN})
        get_target_property(folder ${library} SOURCE_DIR)
        if(EXISTS "${folder}/include")
            install(DIRECTORY "${folder}/include/"
                DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/twinmill" COMPONENT ${name})
        endif()
    endforeach()
endfunction()

set_target_properties(firmware_core PROPERTIES OUTPUT_NAME twinmill_core)
twinmill_install(core firmware_core)
if(TWINMILL_BUILD_TWIN)
    twinmill_install(twin twin
        twin_effects twin_model_file twin_plant twin_predict twin_sensor twin_swarm twin_sweep)
endif()
if(TWINMILL_BUILD_PROGRAMS)
    twinmill_install(mujoco twin_plant_mujoco)
    install(FILES "${PROJECT_SOURCE_DIR}/cmake/FindMuJoCo.cmake"
        DESTINATION "${package_dir}" COMPONENT mujoco)
endif()

set(models_dir "${CMAKE_INSTALL_DATADIR}/twinmill/models")
configure_package_config_file("${CMAKE_CURRENT_LIST_DIR}/twinmillConfig.cmake.in" twinmillConfig.cmake
    INSTALL_DESTINATION "${package_dir}" PATH_VARS models_dir)
write_basic_package_version_file(twinmillConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES
    "${CMAKE_CURRENT_BINARY_DIR}/twinmillConfig.cmake"
    "${CMAKE_CURRENT_BINARY_DIR}/twinmillConfigVersion.cmake"
    DESTINATION "${package_dir}" COMPONENT core)

install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DOCDIR}" COMPONENT core)

file(RELATIVE_PATH prefix_from_here "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")
configure_file("${CMAKE_CURRENT_LIST_DIR}/twinmill-core.pc.in" twinmill-core.pc @ONLY)
install(FILES "${CMAKE_CURRENT_BINARY_DIR}/twinmill-core.pc"
    DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig" COMPONENT core)
