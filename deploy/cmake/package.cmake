# Debian packages by CPack, one for each component; deploy/package builds them. What belongs to a package
# and to no other kind of installation is here: /etc, system users, scripts of the maintainer.
set(TROCAR_MAINTAINER "Trocar developers <packages@trocar.invalid>" CACHE STRING
  "Name and address in the packages: who builds them answers for them")
set(debian "${PROJECT_SOURCE_DIR}/deploy/debian")
set(files "${PROJECT_SOURCE_DIR}/deploy/install")

# The entry on top of the changelog is of this version; every package has the changelog and the licences.
file(STRINGS "${debian}/changelog" entry LIMIT_COUNT 1)
if(NOT entry MATCHES "^trocar \\(${PROJECT_VERSION}-([0-9]+)\\)")
  message(FATAL_ERROR "deploy/debian/changelog: begins with '${entry}', and this is version ${PROJECT_VERSION}")
endif()
set(CPACK_DEBIAN_PACKAGE_RELEASE ${CMAKE_MATCH_1})
file(STRINGS "${PROJECT_SOURCE_DIR}/common/base/version.h" entry REGEX "kVersion")
if(NOT entry MATCHES "\"${PROJECT_VERSION}\"")
  message(FATAL_ERROR "common/base/version.h: says ${entry}, and CMakeLists.txt ${PROJECT_VERSION}")
endif()
set(packaged server client tools web doc)
if(TROCAR_PYTHON)
  list(APPEND packaged python)
endif()
if(TARGET trocar-crtk)
  list(APPEND packaged crtk)
endif()
# package_name(<variable> <component>): Debian names modules for Python by another rule.
function(package_name variable component)
  set(${variable} "trocar-${component}" PARENT_SCOPE)
  if(component STREQUAL "python")
    set(${variable} "python3-trocar" PARENT_SCOPE)
  endif()
endfunction()
if(GZIP_PROGRAM)
  file(MAKE_DIRECTORY "${PROJECT_BINARY_DIR}/debian")
  execute_process(COMMAND "${GZIP_PROGRAM}" -9nc "${debian}/changelog"
    OUTPUT_FILE "${PROJECT_BINARY_DIR}/debian/changelog.Debian.gz" COMMAND_ERROR_IS_FATAL ANY)
endif()
foreach(name IN LISTS packaged)
  package_name(package ${name})
  install(FILES "${debian}/copyright" "${PROJECT_BINARY_DIR}/debian/changelog.Debian.gz"
    DESTINATION "share/doc/${package}" COMPONENT of_${name} EXCLUDE_FROM_ALL)
endforeach()
install(FILES "${files}/lesson.toml" "${files}/hall.toml" DESTINATION /etc/trocar COMPONENT of_server EXCLUDE_FROM_ALL)
install(FILES "${files}/web.toml" DESTINATION /etc/trocar COMPONENT of_web EXCLUDE_FROM_ALL)
install(FILES "${files}/trocar-server.conf" DESTINATION lib/sysusers.d COMPONENT of_server EXCLUDE_FROM_ALL)
if(TROCAR_PYTHON)
  install(TARGETS trocar_module LIBRARY DESTINATION lib/python3/dist-packages/trocar COMPONENT of_python EXCLUDE_FROM_ALL
    PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
  install(DIRECTORY "${written_in_python}" DESTINATION lib/python3/dist-packages COMPONENT of_python EXCLUDE_FROM_ALL
    FILES_MATCHING PATTERN "*.py" PATTERN "*.pyi" PATTERN "py.typed" PATTERN "__pycache__" EXCLUDE)
endif()
install(FILES "${files}/trocar-web.conf" DESTINATION lib/sysusers.d COMPONENT of_web EXCLUDE_FROM_ALL)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME trocar)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "networked surgery simulator")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_OUTPUT_FILE_PREFIX "${PROJECT_SOURCE_DIR}/out/packages")
# A debugger finds the lines of trocar-server in trocar-server-dbgsym, and so on.
set(CPACK_DEBIAN_DEBUGINFO_PACKAGE ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "${TROCAR_MAINTAINER}")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_COMPONENTS_ALL)
foreach(name IN LISTS packaged)
  string(TOUPPER ${name} key)
  package_name(package ${name})
  # Debian's own modules have another folder than what is installed below /usr/local.
  if(NOT name STREQUAL "python")
    list(APPEND CPACK_COMPONENTS_ALL ${name})
  endif()
  list(APPEND CPACK_COMPONENTS_ALL of_${name})
  set(CPACK_COMPONENT_${key}_GROUP ${name})
  set(CPACK_COMPONENT_OF_${key}_GROUP ${name})
  set(CPACK_DEBIAN_${key}_PACKAGE_NAME ${package})
  set(CPACK_DEBIAN_${key}_PACKAGE_SECTION science)
  set(CPACK_DEBIAN_${key}_PACKAGE_CONTROL_EXTRA "${debian}/any/preinst")
endforeach()

# Each is the summary and, from the second line on, the text.
set(processor "The programs need a processor with AVX2 (x86-64-v3).")
set(CPACK_DEBIAN_SERVER_DESCRIPTION "surgery simulator: server of a session
Trocar lets several people, each at a machine of their own, work on one
organ that one server owns. This package has the server. It can run as a
service of systemd, one for each session, and records what is done. A
hall starts sessions on request.
${processor}")
set(CPACK_DEBIAN_CLIENT_DESCRIPTION "surgery simulator: window of a participant
Trocar lets several people, each at a machine of their own, work on one
organ that one server owns. This package has the window in which somebody
takes part in a session, watches one, or plays a recorded one.
${processor}")
set(CPACK_DEBIAN_CRTK_DESCRIPTION "surgery simulator: instruments that robots' programs move
Trocar lets several people, each at a machine of their own, work on one
organ that one server owns. This package lets programs for a da Vinci
Research Kit move instruments of a session, and feel with them, by CRTK
over DDS as in ROS 2.
${processor}")
set(CPACK_DEBIAN_TOOLS_DESCRIPTION "surgery simulator: organs, experiments and recordings
Trocar lets several people, each at a machine of their own, work on one
organ that one server owns. This package makes and inspects organs, runs
experiments without people, checks and assesses recordings, and imitates
a bad network. Scripts of hands and scenarios come with it.
${processor}")
set(CPACK_DEBIAN_WEB_DESCRIPTION "surgery simulator: page for browsers
Trocar lets several people, each at a machine of their own, work on one
organ that one server owns. This package serves a page on which people
watch sessions and recordings, and on which an instructor leads a lesson.
${processor}")
set(CPACK_DEBIAN_PYTHON_DESCRIPTION "surgery simulator: module for Python
Trocar lets several people, each at a machine of their own, work on one
organ that one server owns. This package runs its engine inside Python 3:
organs, scenarios, sessions and recordings as arrays of numpy, tasks
for what learns, and scenes for other programs.
${processor}")
set(CPACK_DEBIAN_DOC_DESCRIPTION "surgery simulator: the book
Trocar lets several people, each at a machine of their own, work on one
organ that one server owns. This package has its book: how lessons are
held, what is measured, how tissue is computed, and where it stops.")

# fontconfig finds the window's font, and GLFW loads X11 and OpenGL, by name: no library list says so.
set(CPACK_DEBIAN_CLIENT_PACKAGE_DEPENDS
  "fonts-dejavu-core, libgl1, libegl1, libgl1-mesa-dri, libegl-mesa0, libglx-mesa0, hicolor-icon-theme")
set(CPACK_DEBIAN_CLIENT_PACKAGE_SUGGESTS "trocar-tools, trocar-doc, fonts-wqy-microhei")
set(sysusers "systemd | systemd-standalone-sysusers | systemd-sysusers")
set(CPACK_DEBIAN_SERVER_PACKAGE_DEPENDS "${sysusers}")
set(CPACK_DEBIAN_SERVER_PACKAGE_RECOMMENDS "trocar-tools")
set(CPACK_DEBIAN_SERVER_PACKAGE_SUGGESTS "avahi-daemon, trocar-web, trocar-doc")
set(CPACK_DEBIAN_TOOLS_PACKAGE_RECOMMENDS "gnuplot-nox, rclone")
set(CPACK_DEBIAN_TOOLS_PACKAGE_SUGGESTS "trocar-client, trocar-doc, weasyprint")
set(CPACK_DEBIAN_CRTK_PACKAGE_SUGGESTS "trocar-server, trocar-client, trocar-doc")
set(CPACK_DEBIAN_WEB_PACKAGE_DEPENDS "${sysusers}")
set(CPACK_DEBIAN_WEB_PACKAGE_RECOMMENDS "trocar-tools")
set(CPACK_DEBIAN_WEB_PACKAGE_SUGGESTS "trocar-server, trocar-doc")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
if(TROCAR_PYTHON)
  # It is for one version of Python.
  math(EXPR next "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
    "python3 (>= 3.${Python_VERSION_MINOR}), python3 (<< 3.${next}), python3-numpy")
endif()
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "trocar-tools")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-matplotlib, python3-pandas, python3-h5py, trocar-doc")
set(CPACK_DEBIAN_DOC_PACKAGE_SECTION doc)
set(CPACK_DEBIAN_DOC_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_DOC_PACKAGE_CONTROL_EXTRA)
foreach(name IN ITEMS server web)
  string(TOUPPER ${name} key)
  list(APPEND CPACK_DEBIAN_${key}_PACKAGE_CONTROL_EXTRA "${debian}/${name}/conffiles" "${debian}/${name}/postinst"
    "${debian}/${name}/prerm" "${debian}/${name}/postrm")
endforeach()
include(CPack)
