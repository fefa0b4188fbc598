# Precompiled headers. The standard library's are two seconds of each source; Google Test and the
# session's own header are most of what a test costs to compile. Only for gcc.
set(TROCAR_PRECOMPILES OFF)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  set(TROCAR_PRECOMPILES ON)
endif()
set(TROCAR_STANDARD_HEADERS
  <algorithm> <array> <atomic> <charconv> <chrono> <cmath> <cstdint> <cstdio> <cstring> <deque> <filesystem>
  <fstream> <functional> <map> <memory> <mutex> <numeric> <optional> <random> <set> <span> <sstream> <string>
  <thread> <utility> <variant> <vector>)
set(TROCAR_SESSION_HEADERS
  "${PROJECT_SOURCE_DIR}/server/organs/catalogue/builtin_organs.h"
  "${PROJECT_SOURCE_DIR}/server/tissue/step/simulation.h")

# Without the first ccache does not see the header. The others: gcc 12 takes std::string + text for an
# overrun (its bug 105651), and says so where the header of strings is precompiled.
set(TROCAR_PRECOMPILED_OPTIONS
  -fpch-preprocess -Wno-array-bounds -Wno-restrict -Wno-stringop-overflow -Wno-stringop-overread)
set(TROCAR_PRECOMPILED_SOURCE "${PROJECT_BINARY_DIR}/precompiled.cpp")
file(CONFIGURE OUTPUT "${TROCAR_PRECOMPILED_SOURCE}" CONTENT "// Carries the flags of precompiled headers.\n")

# What tests check was compiled as users have it; their own sources need no more than this, which takes two
# thirds of the time.
set(TROCAR_TEST_OPTIONS $<$<CONFIG:Release>:-O1> $<$<CONFIG:Release>:-g0>)

# What no tick waits for: a fifth of its time to compile is saved. TROCAR_COLD_FOLDERS says which folders.
set(TROCAR_COLD_OPTIONS $<$<CONFIG:Release>:-O1>)

# Of the product's libraries and programs, one for each level of optimisation: gcc compiles what follows a
# precompiled header with that header's level, whatever it is told. They hold no path of this checkout.
if(TROCAR_PRECOMPILES AND TROCAR_UNITY)
  foreach(name IN ITEMS product cold)
    add_library(trocar_${name}_headers OBJECT "${TROCAR_PRECOMPILED_SOURCE}")
    target_link_libraries(trocar_${name}_headers PRIVATE trocar_options)
    target_precompile_headers(trocar_${name}_headers PRIVATE ${TROCAR_STANDARD_HEADERS})
    target_compile_options(trocar_${name}_headers PRIVATE -fpch-preprocess)
    make_position_independent(trocar_${name}_headers)
  endforeach()
  target_compile_options(trocar_cold_headers PRIVATE ${TROCAR_COLD_OPTIONS})
endif()

# For libraries that make_position_independent() made, and for programs, which are then compiled as these are.
function(use_product_headers target)
  set(headers trocar_product_headers)
  cmake_path(RELATIVE_PATH CMAKE_CURRENT_SOURCE_DIR BASE_DIRECTORY "${PROJECT_SOURCE_DIR}" OUTPUT_VARIABLE folder)
  if(folder IN_LIST TROCAR_COLD_FOLDERS)
    set(headers trocar_cold_headers)
    target_compile_options(${target} PRIVATE ${TROCAR_COLD_OPTIONS})
  endif()
  if(TARGET ${headers})
    get_target_property(type ${target} TYPE)
    if(type STREQUAL "EXECUTABLE")
      target_compile_options(${target} PRIVATE -fPIC ${TROCAR_POSITION_INDEPENDENT_OPTIONS})
    endif()
    target_compile_options(${target} PRIVATE ${TROCAR_PRECOMPILED_OPTIONS})
    target_precompile_headers(${target} REUSE_FROM ${headers})
  endif()
endfunction()

# Of tests, in tests/CMakeLists.txt once all folders are known: trocar_test_headers, and
# trocar_session_test_headers for those that run the tissue.
function(add_precompiled_headers)
  if(NOT TROCAR_PRECOMPILES)
    return()
  endif()
  foreach(name IN ITEMS test session_test)
    add_library(trocar_${name}_headers OBJECT "${TROCAR_PRECOMPILED_SOURCE}")
    target_link_libraries(trocar_${name}_headers PRIVATE trocar_options GTest::gtest)
    set(headers <gtest/gtest.h> ${TROCAR_STANDARD_HEADERS})
    if(name STREQUAL "session_test")
      target_link_libraries(trocar_${name}_headers PRIVATE
        trocar_server_tissue_step trocar_server_organs_catalogue)
      list(APPEND headers ${TROCAR_SESSION_HEADERS})
    endif()
    target_precompile_headers(trocar_${name}_headers PRIVATE ${headers})
    target_compile_options(trocar_${name}_headers PRIVATE -fpch-preprocess ${TROCAR_TEST_OPTIONS})
    # Position-independent as executables are.
    set_target_properties(trocar_${name}_headers PROPERTIES POSITION_INDEPENDENT_CODE OFF)
    if(CCACHE_PROGRAM)
      # A precompiled header holds the paths of what it includes: one from another checkout does not
      # know this one's headers, which would then be read twice.
      set_target_properties(trocar_${name}_headers PROPERTIES CXX_COMPILER_LAUNCHER
        "${CMAKE_COMMAND};-E;env;--unset=CCACHE_NOHASHDIR;CCACHE_BASEDIR=;CCACHE_SLOPPINESS=pch_defines,time_macros;${CCACHE_PROGRAM}")
    endif()
  endforeach()
endfunction()

# use_test_headers(<target> <folder>...): the folders are what the target depends on.
function(use_test_headers target)
  if(NOT TROCAR_PRECOMPILES)
    return()
  endif()
  target_compile_options(${target} PRIVATE ${TROCAR_PRECOMPILED_OPTIONS})
  if(server/tissue/step IN_LIST ARGN)
    target_precompile_headers(${target} REUSE_FROM trocar_session_test_headers)
  else()
    target_precompile_headers(${target} REUSE_FROM trocar_test_headers)
  endif()
endfunction()
