# project_library(<folder> ABOUT "What it is for." SOURCES a.cpp... HEADERS a.h... DEPENDS common/base...
#                 USES server/x... LINK pkg... [JOINED])
# One folder, one static library: target trocar_<folder with _>, alias trocar::<folder with _>.
# ABOUT is the folder's line in docs/folders.md. DEPENDS names the folders that its headers include
# (public), USES those that only its sources include (private), LINK third-party targets (public).
# tests/architecture compares DEPENDS and USES with the sources. JOINED: its sources are compiled
# together, where the headers of what they use (Eigen, toml++) take longest.
function(project_library folder)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "JOINED" "ABOUT" "SOURCES;HEADERS;DEPENDS;USES;LINK")
  if(ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "project_library(${folder}): unknown arguments ${ARG_UNPARSED_ARGUMENTS}")
  endif()
  string(REPLACE "/" "_" name ${folder})
  add_library(trocar_${name} STATIC ${ARG_SOURCES})
  add_library(trocar::${name} ALIAS trocar_${name})
  # A source includes the header of its own name first (tests/architecture), which shows that this
  # header compiles alone. Only the others are compiled by all_verify_interface_header_sets.
  set(lone_headers ${ARG_HEADERS})
  foreach(source IN LISTS ARG_SOURCES)
    string(REGEX REPLACE "\\.cpp$" ".h" header ${source})
    list(REMOVE_ITEM lone_headers ${header})
  endforeach()
  if(lone_headers)
    target_sources(trocar_${name} PUBLIC FILE_SET lone TYPE HEADERS BASE_DIRS "${PROJECT_SOURCE_DIR}"
      FILES ${lone_headers})
  endif()
  set_property(GLOBAL APPEND PROPERTY TROCAR_LIBRARIES trocar_${name})
  if(ARG_JOINED OR TROCAR_UNITY)
    # The headers that they share take longest: a dozen at a time, and of more no small rest. The folders of the
    # state take long by themselves.
    set_target_properties(trocar_${name} PROPERTIES UNITY_BUILD ON)
    if(NOT folder IN_LIST TROCAR_STATE_FOLDERS)
      list(LENGTH ARG_SOURCES count)
      math(EXPR parts "(${count} + 11) / 12")
      math(EXPR batch "(${count} + ${parts} - 1) / ${parts}")
      if(parts EQUAL 1)
        set(batch 12)
      endif()
      set_target_properties(trocar_${name} PROPERTIES UNITY_BUILD_BATCH_SIZE ${batch})
    endif()
  endif()
  make_position_independent(trocar_${name})
  use_product_headers(trocar_${name})
  target_link_libraries(trocar_${name} PUBLIC trocar_options)
  foreach(dependency IN LISTS ARG_DEPENDS)
    string(REPLACE "/" "_" dependency_name ${dependency})
    target_link_libraries(trocar_${name} PUBLIC trocar_${dependency_name})
  endforeach()
  foreach(dependency IN LISTS ARG_USES)
    string(REPLACE "/" "_" dependency_name ${dependency})
    target_link_libraries(trocar_${name} PRIVATE trocar_${dependency_name})
  endforeach()
  target_link_libraries(trocar_${name} PUBLIC ${ARG_LINK})
endfunction()

# project_program(<name> [ABOUT "What its folder is for."] MAIN file.cpp DEPENDS folder... LINK target...
#                 [JOINED] [ON_DEMAND]): one executable in build/<preset>/bin. DEPENDS names the folders
# that its files include. JOINED: its files are compiled together. ON_DEMAND: a build makes it only when it
# is named; for what measures or writes. All of these together are the target on_demand.
add_custom_target(on_demand)
function(project_program name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "JOINED;ON_DEMAND" "ABOUT" "MAIN;DEPENDS;LINK")
  add_executable(${name} ${ARG_MAIN})
  use_product_headers(${name})
  if(ARG_ON_DEMAND)
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL TRUE)
    add_dependencies(on_demand ${name})
  endif()
  if(ARG_JOINED OR TROCAR_UNITY)
    set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 12)
  endif()
  target_link_libraries(${name} PRIVATE trocar_options ${ARG_LINK})
  foreach(dependency IN LISTS ARG_DEPENDS)
    string(REPLACE "/" "_" dependency_name ${dependency})
    target_link_libraries(${name} PRIVATE trocar_${dependency_name})
  endforeach()
endfunction()
