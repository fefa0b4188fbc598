# project_test(<name> SOURCES x_test.cpp... DEPENDS folder... [LINK target...] [READS path...] [COST seconds]
#              [TIMEOUT seconds] [READER | SANITIZED] [ALONE] [APART] [OPTIMISED]
#              [CAMPAIGN])
# A GoogleTest program. deploy/test runs all its tests in one process, or in several parts if they take long,
# so what several of them need (an organ, for example) is made once. READS: files and folders of the
# repository that they open. COST: about how long all of them take, on one core. READER: it tests what
# reads or decodes outside data, so deploy/test --with-clang runs it a second time with address and
# undefined-behaviour sanitizers. SANITIZED: deploy/campaign sanitized does, as for readers. ALONE: no other test
# runs beside it; for what measures time. CAMPAIGN: takes long, so only deploy/campaign runs it.
# Its sources are compiled together, a dozen at a time, because their headers take longest. APART: one by one,
# where they define the same names. OPTIMISED: its own sources are compiled as the product is; where they
# assert times, or hashes of what they compute themselves.
#
# script_test(<name> COMMAND program argument... [PROGRAMS target...] [READS path...] [AFTER test...]
#             [ENVIRONMENT NAME=value...] [COST seconds] [TIMEOUT seconds] [SKIP_CODE n] [ALONE] [WEB] [CAMPAIGN])
# A script that is one test. PROGRAMS: what it starts, or takes from the build folder. AFTER: tests that leave
# what this one begins with. SKIP_CODE: its exit code, if not 77, where something is missing that it needs.
# WEB: needs the page for browsers; deploy/test --with-web runs it.
#
# Both are ctest tests, too.
add_custom_target(sanitized_tests)

function(project_test name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "READER;SANITIZED;ALONE;APART;OPTIMISED;CAMPAIGN" "TIMEOUT;COST" "SOURCES;DEPENDS;LINK;READS")
  if(ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "project_test(${name}): unknown arguments ${ARG_UNPARSED_ARGUMENTS}")
  endif()
  add_executable(${name} ${ARG_SOURCES})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/tests")
  if(NOT ARG_APART)
    set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 12)
  endif()
  if(ARG_CAMPAIGN)
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL TRUE)
    add_dependencies(on_demand ${name})
  endif()
  # What tests share (tests/support) starts programs.
  target_link_libraries(${name} PRIVATE trocar_options GTest::gtest_main trocar_common_process ${ARG_LINK})
  foreach(dependency IN LISTS ARG_DEPENDS)
    string(REPLACE "/" "_" dependency_name ${dependency})
    target_link_libraries(${name} PRIVATE trocar_${dependency_name})
  endforeach()
  if(NOT ARG_OPTIMISED)
    target_compile_options(${name} PRIVATE ${TROCAR_TEST_OPTIONS})
    use_test_headers(${name} ${ARG_DEPENDS})
  endif()
  target_compile_definitions(${name} PRIVATE
    TROCAR_SOURCE_DIR="${PROJECT_SOURCE_DIR}" TROCAR_BINARY_DIR="${PROJECT_BINARY_DIR}/bin")
  if(ARG_READER OR ARG_SANITIZED)
    add_dependencies(sanitized_tests ${name})
  endif()
  # Servers that tests start keep certificate and codes out of the user's folders.
  list_test(${name} gtest "$<TARGET_FILE:${name}>" "${name}" "XDG_STATE_HOME=${PROJECT_BINARY_DIR}/state" "")
endfunction()

function(script_test name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "ALONE;WEB;CAMPAIGN" "TIMEOUT;COST;SKIP_CODE"
    "COMMAND;PROGRAMS;READS;AFTER;ENVIRONMENT")
  if(ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "script_test(${name}): unknown arguments ${ARG_UNPARSED_ARGUMENTS}")
  endif()
  # It is made of the folder that names it.
  file(RELATIVE_PATH folder "${PROJECT_SOURCE_DIR}" "${CMAKE_CURRENT_SOURCE_DIR}")
  list(APPEND ARG_READS ${folder})
  if(TARGET web_page AND ARG_WEB)
    list(APPEND ARG_PROGRAMS web_page)
  endif()
  list_test(${name} script "${ARG_COMMAND}" "${ARG_PROGRAMS}" "${ARG_ENVIRONMENT}" "${ARG_AFTER}")
endfunction()

# list_test(<name> <kind> <command> <targets> <environment> <after>): what both have in common, once as a line
# for tests.json and once for ctest. Takes the other ARG_ variables of its caller.
function(list_test name kind command targets environment after)
  foreach(default IN ITEMS TIMEOUT:300 COST:1 SKIP_CODE:77)
    string(REPLACE ":" ";" default ${default})
    list(GET default 0 variable)
    if(NOT DEFINED ARG_${variable})
      list(GET default 1 ARG_${variable})
    endif()
  endforeach()
  set(part "")
  if(ARG_CAMPAIGN)
    set(part "campaign")
  elseif(ARG_WEB)
    set(part "web")
  endif()
  set(alone false)
  if(ARG_ALONE)
    set(alone true)
  endif()
  set(sanitized "")
  if(ARG_READER)
    set(sanitized "change")
  elseif(ARG_SANITIZED)
    set(sanitized "campaign")
  endif()
  set(pairs)
  foreach(entry IN LISTS environment)
    string(REGEX REPLACE "^([^=]+)=(.*)$" "\"\\1\": \"\\2\"" pair "${entry}")
    list(APPEND pairs "${pair}")
  endforeach()
  list(JOIN pairs ", " pairs)
  foreach(variable IN ITEMS command targets after ARG_READS)
    json_array(${variable} ${${variable}})
  endforeach()
  set_property(GLOBAL APPEND PROPERTY TROCAR_TEST_LINES "{\"name\": \"${name}\", \"kind\": \"${kind}\", \
\"command\": ${command_json}, \"targets\": ${targets_json}, \"reads\": ${ARG_READS_json}, \"after\": ${after_json}, \
\"environment\": {${pairs}}, \"timeout\": ${ARG_TIMEOUT}, \"cost\": ${ARG_COST}, \"skip_code\": ${ARG_SKIP_CODE}, \
\"alone\": ${alone}, \"part\": \"${part}\", \"sanitized\": \"${sanitized}\"}")

  add_test(NAME ${name} COMMAND ${command})
  set_tests_properties(${name} PROPERTIES TIMEOUT 3600 RUN_SERIAL ${alone} SKIP_RETURN_CODE ${ARG_SKIP_CODE}
    ENVIRONMENT "${environment}" LABELS "${part}")
  if(after)
    set_tests_properties(${name} PROPERTIES DEPENDS "${after}")
  endif()
endfunction()
