# project_test(<name> SOURCES x_test.cpp... DEPENDS folder... [LINK target...] [SANITIZED] [ALONE] [APART]
#              [TOGETHER] [CAMPAIGN])
# A GoogleTest program; each of its tests becomes one ctest test. SANITIZED: deploy/test runs it a second
# time with address and undefined-behaviour sanitizers; for what reads outside data. ALONE: no other
# test runs beside it; for sessions in real time. Its sources are compiled together, a dozen at a time,
# because their headers take longest. APART: one by one, where they define the same names. TOGETHER: the
# program is one ctest test, because its tests share what takes long to make. CAMPAIGN: deploy/campaign
# builds and runs it, no change has to pass it (`ctest -C campaign`).
add_custom_target(sanitized_tests)
function(project_test name)
  cmake_parse_arguments(ARG "SANITIZED;ALONE;APART;TOGETHER;CAMPAIGN" "TIMEOUT" "SOURCES;DEPENDS;LINK" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/tests")
  if(NOT ARG_APART)
    set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 12)
  endif()
  target_link_libraries(${name} PRIVATE trocar_options GTest::gtest_main ${ARG_LINK})
  foreach(dependency IN LISTS ARG_DEPENDS)
    string(REPLACE "/" "_" dependency_name ${dependency})
    target_link_libraries(${name} PRIVATE trocar_${dependency_name})
  endforeach()
  use_precompiled_headers(${name} test ${ARG_DEPENDS})
  target_compile_definitions(${name} PRIVATE
    TROCAR_SOURCE_DIR="${PROJECT_SOURCE_DIR}" TROCAR_BINARY_DIR="${PROJECT_BINARY_DIR}/bin")
  set(labels)
  set(alone)
  if(ARG_ALONE)
    set(alone RUN_SERIAL TRUE)
  endif()
  if(ARG_SANITIZED)
    set(labels LABELS sanitized)
    add_dependencies(sanitized_tests ${name})
  endif()
  set(properties TIMEOUT ${ARG_TIMEOUT} ${labels} ${alone}
    # Servers that tests start keep certificate and codes out of the user's folders.
    ENVIRONMENT "XDG_STATE_HOME=${PROJECT_BINARY_DIR}/state")
  if(ARG_CAMPAIGN)
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL TRUE)
    add_dependencies(on_demand ${name})
    add_test(NAME ${name} COMMAND ${name} CONFIGURATIONS campaign)
    set_tests_properties(${name} PROPERTIES ${properties} LABELS campaign)
  elseif(ARG_TOGETHER)
    add_test(NAME ${name} COMMAND ${name})
    set_tests_properties(${name} PROPERTIES ${properties})
  else()
    gtest_discover_tests(${name} TEST_PREFIX "${name}." DISCOVERY_TIMEOUT 60 PROPERTIES ${properties})
  endif()
endfunction()
