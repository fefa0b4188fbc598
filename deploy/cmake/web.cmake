# The page for browsers: its parts need tools that nothing else does. TROCAR_WEB says whether it is
# built; where something is missing it is not, with a line that says what.
option(TROCAR_WEB "Build the page for browsers (needs clang for WebAssembly, Node.js, npm)" ON)

# web_tools(<variable>): the names of what is missing, empty if nothing is.
function(web_tools variable)
  set(missing)
  find_program(TROCAR_WASM_CXX NAMES clang++-19)
  find_program(TROCAR_WASM_LINKER NAMES wasm-ld-19)
  find_program(TROCAR_NODE NAMES node)
  find_program(TROCAR_NPM NAMES npm)
  foreach(tool IN ITEMS WASM_CXX:clang-19 WASM_LINKER:lld-19 NODE:nodejs NPM:npm)
    string(REPLACE ":" ";" tool ${tool})
    list(GET tool 0 name)
    list(GET tool 1 package)
    if(NOT TROCAR_${name})
      list(APPEND missing ${package})
    endif()
  endforeach()
  find_path(TROCAR_WASM_LIBCXX NAMES algorithm NO_DEFAULT_PATH
    PATHS /usr/lib/llvm-19/include/wasm32-wasi/c++/v1)
  if(NOT TROCAR_WASM_LIBCXX)
    list(APPEND missing libc++-19-dev-wasm32)
  endif()
  # Debian has Protocol Buffers for this machine only; the module compiles its sources.
  set(TROCAR_PROTOBUF_SOURCE "${PROJECT_SOURCE_DIR}/build/sources/protobuf-${Protobuf_VERSION}"
    CACHE PATH "Sources of Protocol Buffers, of the version that is installed")
  if(NOT EXISTS "${TROCAR_PROTOBUF_SOURCE}/cmake/libprotobuf-lite.cmake")
    list(APPEND missing "sources of Protocol Buffers ${Protobuf_VERSION}")
  endif()
  set(${variable} "${missing}" PARENT_SCOPE)
endfunction()

if(TROCAR_WEB AND TROCAR_SANITIZE)
  message(STATUS "The page for browsers is not built with sanitizers")
  set(TROCAR_WEB OFF)
elseif(TROCAR_WEB)
  web_tools(missing)
  if(missing)
    list(JOIN missing ", " missing)
    message(STATUS "The page for browsers is not built: missing ${missing}; deploy/setup --with-web installs it")
    set(TROCAR_WEB OFF)
  endif()
endif()

# wasm_module(<name> SOURCES file...): the target <name>, a WebAssembly module in <build>/web, compiled from
# sources that the native programs have, too.
function(wasm_module name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "" "SOURCES")
  set(work "${CMAKE_CURRENT_BINARY_DIR}")
  # The standard library for WebAssembly has no threads, and the log no sink there.
  file(CONFIGURE OUTPUT "${work}/stubs/one_thread.h" CONTENT [=[
#pragma once
#ifdef __cplusplus
#include <mutex>
namespace std {
struct mutex {
  void lock() {}
  void unlock() {}
  bool try_lock() { return true; }
};
}  // namespace std
#endif
]=])
  file(CONFIGURE OUTPUT "${work}/stubs/spdlog/spdlog.h" CONTENT [=[
#pragma once
namespace spdlog {
template <typename... Parts> void debug(const Parts&...) {}
template <typename... Parts> void error(const Parts&...) {}
template <typename... Parts> void info(const Parts&...) {}
template <typename... Parts> void warn(const Parts&...) {}
}  // namespace spdlog
]=])
  set(generated "${work}/generated")
  file(MAKE_DIRECTORY "${generated}")
  add_custom_command(
    OUTPUT "${generated}/proto/wire.pb.cc" "${generated}/proto/wire.pb.h"
           "${generated}/proto/fine_surface.pb.cc" "${generated}/proto/fine_surface.pb.h"
    COMMAND protobuf::protoc "--proto_path=${PROJECT_SOURCE_DIR}" "--cpp_out=lite:${generated}" proto/wire.proto
            proto/fine_surface.proto
    WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}"
    DEPENDS "${PROJECT_SOURCE_DIR}/proto/wire.proto" "${PROJECT_SOURCE_DIR}/proto/fine_surface.proto" VERBATIM)
  set(protobuf "${TROCAR_PROTOBUF_SOURCE}/src")
  file(STRINGS "${TROCAR_PROTOBUF_SOURCE}/cmake/libprotobuf-lite.cmake" listed REGEX "\\.cc$")
  set(sources ${ARG_SOURCES} "${generated}/proto/wire.pb.cc" "${generated}/proto/fine_surface.pb.cc")
  foreach(line IN LISTS listed)
    string(REGEX REPLACE "^.*/src/" "" line "${line}")
    if(NOT line MATCHES "io_win32|arenaz_sampler")
      list(APPEND sources "${protobuf}/${line}")
    endif()
  endforeach()
  set(target --target=wasm32-wasi -Os -fno-exceptions -fno-rtti -mbulk-memory -msimd128)
  set(flags ${target} -std=c++20 -fvisibility=hidden -ffp-contract=off -DNDEBUG -DGOOGLE_PROTOBUF_NO_RTTI=1
    -DPROTOBUF_USE_EXCEPTIONS=0 -D_WASI_EMULATED_MMAN -isystem "${TROCAR_WASM_LIBCXX}"
    -include "${work}/stubs/one_thread.h" "-I${work}/stubs" "-I${generated}" -isystem "${protobuf}"
    "-I${PROJECT_SOURCE_DIR}")
  set(objects)
  foreach(source IN LISTS sources)
    set(warnings -Wall -Wextra -Wno-missing-field-initializers -Werror)
    if(source MATCHES "\\.cc$")
      set(warnings -w)
    endif()
    string(MD5 hash "${source}")
    get_filename_component(stem "${source}" NAME_WE)
    set(object "${work}/${stem}-${hash}.o")
    add_custom_command(OUTPUT "${object}"
      COMMAND ${CMAKE_CXX_COMPILER_LAUNCHER} "${TROCAR_WASM_CXX}" ${flags} ${warnings} -MD -MF "${object}.d" -c
              "${source}" -o "${object}"
      DEPENDS "${source}" "${generated}/proto/wire.pb.h" DEPFILE "${object}.d"
      COMMENT "Compiling ${stem} for WebAssembly" VERBATIM)
    list(APPEND objects "${object}")
  endforeach()
  set(module "${PROJECT_BINARY_DIR}/web/${name}.wasm")
  file(MAKE_DIRECTORY "${PROJECT_BINARY_DIR}/web")
  add_custom_command(OUTPUT "${module}"
    COMMAND "${TROCAR_WASM_CXX}" ${target} -mexec-model=reactor -Wl,--gc-sections -Wl,--strip-all
            -Wl,-z,stack-size=262144 ${objects} -o "${module}"
    DEPENDS ${objects} COMMENT "Linking ${name}.wasm" VERBATIM)
  add_custom_target(${name} DEPENDS "${module}")
  set_target_properties(${name} PROPERTIES TROCAR_FILES "${ARG_SOURCES}")
endfunction()
