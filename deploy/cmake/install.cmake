# What `cmake --install build/release` copies, as one component for each package: server, client, crtk,
# tools, web, python and doc. Programs look for nothing but what lies beside them: the page of trocar-web is in
# <prefix>/share/trocar/web. Files of /etc belong to the packages alone (deploy/cmake/package.cmake).
include(GNUInstallDirs)
set(TROCAR_COMPONENT_PROGRAMS
  server:trocar-server server:trocar-hall server:trocar-relay client:trocar-client client:trocar-doctor client:trocar-organ-edit client:trocar-igtl
  crtk:trocar-crtk
  web:trocar-web
  tools:trocar-organ tools:trocar-sim tools:trocar-journal tools:trocar-impair)
set(files "${PROJECT_SOURCE_DIR}/deploy/install")
set(share "${CMAKE_INSTALL_DATADIR}")
set(doc "${share}/doc")
# A page of the manual and a completion for bash, both made from the program's own --help.
find_program(HELP2MAN_PROGRAM help2man)
find_program(GZIP_PROGRAM gzip)
set(made "${PROJECT_BINARY_DIR}/manuals")
set(manuals)

# Installed programs have no lines for debuggers. CPack takes them into packages of their own.
install(CODE [[
  if(NOT "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}" MATCHES "/_CPack_Packages/")
    set(CMAKE_INSTALL_DO_STRIP ON)
  endif()]] ALL_COMPONENTS)
foreach(entry IN LISTS TROCAR_COMPONENT_PROGRAMS)
  string(REPLACE ":" ";" entry ${entry})
  list(GET entry 0 component)
  list(GET entry 1 program)
  if(NOT TARGET ${program})
    continue()
  endif()
  # Addresses of library functions are looked up at the start, and then nobody writes to their table.
  target_link_options(${program} PRIVATE -Wl,-z,relro,-z,now)
  install(TARGETS ${program} RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}" COMPONENT ${component})
  add_custom_command(OUTPUT "${made}/${program}.bash"
    COMMAND "${PROJECT_SOURCE_DIR}/deploy/lib/completion" $<TARGET_FILE:${program}> "${made}/${program}.bash"
    DEPENDS ${program} "${PROJECT_SOURCE_DIR}/deploy/lib/completion"
    COMMENT "Making the completion of ${program}" VERBATIM)
  list(APPEND manuals "${made}/${program}.bash")
  install(FILES "${made}/${program}.bash" DESTINATION "${share}/bash-completion/completions"
    RENAME ${program} COMPONENT ${component} OPTIONAL)
  if(HELP2MAN_PROGRAM AND GZIP_PROGRAM)
    add_custom_command(OUTPUT "${made}/${program}.1.gz"
      COMMAND "${PROJECT_SOURCE_DIR}/deploy/lib/manual" $<TARGET_FILE:${program}> ${PROJECT_VERSION}
              "${made}/${program}.1.gz"
      DEPENDS ${program} "${PROJECT_SOURCE_DIR}/deploy/lib/manual"
      COMMENT "Making the page of ${program} for man" VERBATIM)
    list(APPEND manuals "${made}/${program}.1.gz")
    install(FILES "${made}/${program}.1.gz" DESTINATION "${CMAKE_INSTALL_MANDIR}/man1" COMPONENT ${component} OPTIONAL)
  endif()
endforeach()
# Not of `all`: each page starts a program, and only who installs wants it.
add_custom_target(manuals DEPENDS ${manuals})

install(FILES "${files}/trocar@.service" DESTINATION lib/systemd/system COMPONENT server)
install(FILES "${files}/trocar-hall.service" DESTINATION lib/systemd/system COMPONENT server)
install(FILES "${PROJECT_SOURCE_DIR}/deploy/trocar-hall.toml.example"
  DESTINATION "${doc}/trocar-server/examples" RENAME trocar-hall.toml COMPONENT server)
install(FILES "${PROJECT_SOURCE_DIR}/deploy/trocar-server.toml.example"
  DESTINATION "${doc}/trocar-server/examples" RENAME trocar-server.toml COMPONENT server)
install(FILES "${files}/trocar-relay@.service" DESTINATION lib/systemd/system COMPONENT server)
install(FILES "${PROJECT_SOURCE_DIR}/deploy/trocar-relay.toml.example"
  DESTINATION "${doc}/trocar-server/examples" RENAME trocar-relay.toml COMPONENT server)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/deploy/monitoring" DESTINATION "${doc}/trocar-server/examples" COMPONENT server)

install(FILES "${files}/trocar-client.desktop" "${files}/trocar-join.desktop" "${files}/trocar-replay.desktop"
  DESTINATION "${share}/applications" COMPONENT client)
install(FILES "${files}/trocar.svg" DESTINATION "${share}/icons/hicolor/scalable/apps" COMPONENT client)
install(FILES "${files}/application-x-trocar-recording.svg"
  DESTINATION "${share}/icons/hicolor/scalable/mimetypes" COMPONENT client)
install(FILES "${files}/trocar.xml" DESTINATION "${share}/mime/packages" COMPONENT client)

# Scripts of hands, scenarios and their curves.
install(DIRECTORY "${PROJECT_SOURCE_DIR}/deploy/scenes" DESTINATION "${share}/trocar" COMPONENT tools)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/deploy/threads" DESTINATION "${share}/trocar" COMPONENT server)

install(FILES "${PROJECT_SOURCE_DIR}/deploy/trocar-web.service" DESTINATION lib/systemd/system COMPONENT web)
install(FILES "${PROJECT_SOURCE_DIR}/deploy/trocar-web.toml.example"
  DESTINATION "${doc}/trocar-web/examples" RENAME trocar-web.toml COMPONENT web)
if(TROCAR_WEB)
  # Each file lies there compressed, too: the program sends it as it is.
  install(DIRECTORY "${PROJECT_BINARY_DIR}/web/page/" DESTINATION "${share}/trocar/web" COMPONENT web
    FILE_PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
endif()

# Debian's Python looks here below /usr/local; the package has another folder (deploy/cmake/package.cmake).
if(TROCAR_PYTHON)
  target_link_options(trocar_module PRIVATE -Wl,-z,relro,-z,now)
  set(python_files "${PROJECT_SOURCE_DIR}/deploy/python")
  set(modules "lib/python${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}/dist-packages")
  set(written_in_python "${PROJECT_SOURCE_DIR}/server/python/trocar")
  install(TARGETS trocar_module LIBRARY COMPONENT python PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ
    DESTINATION "${modules}/trocar")
  install(DIRECTORY "${written_in_python}" DESTINATION "${modules}" COMPONENT python
    FILES_MATCHING PATTERN "*.py" PATTERN "*.pyi" PATTERN "py.typed" PATTERN "__pycache__" EXCLUDE)
  # They find the scenarios in the folder beside theirs.
  foreach(component IN ITEMS python of_python)
    set(all)
    if(component STREQUAL "of_python")
      set(all EXCLUDE_FROM_ALL)
    endif()
    install(DIRECTORY "${python_files}/" DESTINATION "${share}/trocar/python" COMPONENT ${component} ${all}
      FILES_MATCHING PATTERN "*.py")
  endforeach()
endif()

install(FILES "${PROJECT_SOURCE_DIR}/README.md" "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${doc}/trocar"
  COMPONENT doc)
install(FILES "${PROJECT_SOURCE_DIR}/deploy/picture.jpg" DESTINATION "${doc}/trocar/deploy" COMPONENT doc)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/docs" DESTINATION "${doc}/trocar" COMPONENT doc)
