# Precompiled headers. Google Test and the session's own header are most of what a test costs to
# compile. Only for gcc.
set(TROCAR_PRECOMPILES OFF)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  set(TROCAR_PRECOMPILES ON)
endif()
set(TROCAR_STANDARD_HEADERS
  <algorithm> <array> <cmath> <cstdint> <filesystem> <fstream> <functional> <map> <memory> <numeric>
  <optional> <random> <set> <span> <sstream> <string> <thread> <vector>)
set(TROCAR_SESSION_HEADERS
  "${PROJECT_SOURCE_DIR}/server/organs/catalogue/builtin_organs.h"
  "${PROJECT_SOURCE_DIR}/server/tissue/step/simulation.h")

# One target for each precompiled header, in tests/CMakeLists.txt once all folders are known:
# trocar_test_headers, trocar_session_test_headers and, without Google Test, trocar_session_headers.
function(add_precompiled_headers)
  if(NOT TROCAR_PRECOMPILES)
    return()
  endif()
  set(source "${PROJECT_BINARY_DIR}/precompiled.cpp")
  file(CONFIGURE OUTPUT "${source}" CONTENT "// Carries the flags of precompiled headers.\n")
  foreach(name IN ITEMS test session_test session)
    add_library(trocar_${name}_headers OBJECT "${source}")
    target_link_libraries(trocar_${name}_headers PRIVATE trocar_options)
    set(headers ${TROCAR_STANDARD_HEADERS})
    if(name MATCHES "test")
      target_link_libraries(trocar_${name}_headers PRIVATE GTest::gtest)
      list(PREPEND headers <gtest/gtest.h>)
    endif()
    if(name MATCHES "session")
      target_link_libraries(trocar_${name}_headers PRIVATE
        trocar_server_tissue_step trocar_server_organs_catalogue)
      list(APPEND headers ${TROCAR_SESSION_HEADERS})
    endif()
    target_precompile_headers(trocar_${name}_headers PRIVATE ${headers})
    target_compile_options(trocar_${name}_headers PRIVATE -fpch-preprocess)
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

# use_precompiled_headers(<target> <kind> <folder>...): `kind` is test or program, the folders what
# the target depends on.
function(use_precompiled_headers target kind)
  if(NOT TROCAR_PRECOMPILES)
    return()
  endif()
  if(server/tissue/step IN_LIST ARGN OR kind STREQUAL "test")
    # Without the first ccache does not see the header. The others: gcc 12 takes std::string + text
    # for an overrun (its bug 105651), and says so where the header of strings is precompiled.
    target_compile_options(${target} PRIVATE -fpch-preprocess -Wno-array-bounds -Wno-restrict)
  endif()
  if(server/tissue/step IN_LIST ARGN)
    if(kind STREQUAL "test")
      target_precompile_headers(${target} REUSE_FROM trocar_session_test_headers)
    else()
      target_precompile_headers(${target} REUSE_FROM trocar_session_headers)
    endif()
  elseif(kind STREQUAL "test")
    target_precompile_headers(${target} REUSE_FROM trocar_test_headers)
  endif()
endfunction()
