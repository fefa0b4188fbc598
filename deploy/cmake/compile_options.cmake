# One interface target carries language level, warnings and the flags that determinism needs.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)

# -g1 keeps back traces readable at a tenth of the size of full debug information.
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -g1" CACHE STRING "" FORCE)
set(CMAKE_CXX_FLAGS_DEBUG "-O0 -g" CACHE STRING "" FORCE)
set(CMAKE_CXX_FLAGS_SANITIZE "-O1 -g1" CACHE STRING "" FORCE)

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # Without these two settings ccache keeps nothing that uses a precompiled header.
  set(CMAKE_CXX_COMPILER_LAUNCHER
    ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE_PROGRAM})
endif()
find_program(MOLD_PROGRAM mold)
if(MOLD_PROGRAM AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_link_options(-fuse-ld=mold)
endif()

add_library(trocar_options INTERFACE)
target_include_directories(trocar_options INTERFACE "${PROJECT_SOURCE_DIR}")
target_compile_options(trocar_options INTERFACE
  -march=${TROCAR_ISA}
  # A contracted multiply-add rounds once where the source rounds twice, and compilers choose
  # differently where to contract: state hashes would depend on the compiler.
  -ffp-contract=off
  -Wall -Wextra -Wno-missing-field-initializers -Wshadow -Wconversion -Wno-sign-conversion -Wnon-virtual-dtor -Werror
  $<$<CXX_COMPILER_ID:GNU>:-Wno-psabi>)
if(TROCAR_SANITIZE)
  add_compile_options(-fsanitize=${TROCAR_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${TROCAR_SANITIZE})
  if(TROCAR_SANITIZE MATCHES "thread")
    add_compile_options(-Wno-tsan)
    add_compile_definitions(BOOST_ASIO_DISABLE_FENCED_BLOCK)
  else()
    add_compile_options(-fno-sanitize-recover=all)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
      # Clang 14 cannot assemble coroutines with this check; gcc does not have it.
      add_compile_options(-fno-sanitize=function)
    endif()
  endif()
endif()
