# Every third-party package, once. Versions are those of Debian 12 (deploy/setup installs them).
find_package(Threads REQUIRED)
find_package(PkgConfig REQUIRED)
find_package(Boost 1.81 REQUIRED)
find_package(Protobuf REQUIRED)
find_package(spdlog REQUIRED)
find_package(CLI11 REQUIRED)
find_package(tomlplusplus REQUIRED)
find_package(Ceres REQUIRED)
find_package(Eigen3 REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(ZLIB REQUIRED)
find_package(PNG REQUIRED)
pkg_check_modules(turbojpeg REQUIRED IMPORTED_TARGET libturbojpeg)
find_package(DCMTK REQUIRED CONFIG)
find_package(OpenSSL 3.0 REQUIRED)
# Only its libraries: the definition that comes with them would keep out the precompiled headers.
pkg_check_modules(avahi REQUIRED avahi-client)
pkg_check_modules(qrencode REQUIRED IMPORTED_TARGET libqrencode)
# Halls do without it.
pkg_check_modules(nats IMPORTED_TARGET libnats)
pkg_check_modules(icu REQUIRED IMPORTED_TARGET icu-i18n icu-uc)
pkg_check_modules(zstd REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(xxhash REQUIRED IMPORTED_TARGET libxxhash)
if(TROCAR_CLIENT)
  find_package(glfw3 REQUIRED)
  find_package(OpenGL REQUIRED COMPONENTS OpenGL EGL)
  pkg_check_modules(imgui REQUIRED IMPORTED_TARGET imgui)
  pkg_check_modules(fontconfig REQUIRED IMPORTED_TARGET fontconfig)
  # Robots' door, which a build may do without.
  find_package(CycloneDDS 0.10 CONFIG QUIET)
  find_program(IDLC_PROGRAM idlc)
  if(CycloneDDS_FOUND AND IDLC_PROGRAM)
    set(TROCAR_HAS_CYCLONE ON)
  else()
    message(STATUS "trocar-crtk is left out: it needs cyclonedds-dev and cyclonedds-tools")
  endif()
endif()
# OpenIGTLink's own CMake package changes the flags of all that is compiled. Without it there is no trocar-igtl.
find_path(OPENIGTLINK_INCLUDE igtlMessageBase.h PATH_SUFFIXES openigtlink)
find_library(OPENIGTLINK_LIBRARY OpenIGTLink)
if(OPENIGTLINK_INCLUDE AND OPENIGTLINK_LIBRARY)
  add_library(trocar_openigtlink INTERFACE)
  target_include_directories(trocar_openigtlink SYSTEM INTERFACE ${OPENIGTLINK_INCLUDE})
  target_link_libraries(trocar_openigtlink INTERFACE ${OPENIGTLINK_LIBRARY})
endif()
if(TROCAR_TESTS)
  find_package(GTest REQUIRED)
  include(GoogleTest)
  # Benchmarks, and the library they compare with (single precision).
  find_package(benchmark REQUIRED)
  pkg_check_modules(bullet REQUIRED IMPORTED_TARGET bullet)
  # Another maker's DDS, to test ours with.
  find_package(fastrtps 2.9 CONFIG QUIET)
endif()

# Asio compiled once (common/base) instead of in every file that includes it.
add_library(trocar_boost INTERFACE)
target_include_directories(trocar_boost SYSTEM INTERFACE ${Boost_INCLUDE_DIRS})
target_compile_definitions(trocar_boost INTERFACE
  BOOST_ASIO_SEPARATE_COMPILATION BOOST_ASIO_NO_DEPRECATED BOOST_ALL_NO_LIB)

# CHOLMOD of SuiteSparse, which has no CMake package in Debian 12: Cholesky factors of sparse matrices.
find_path(CHOLMOD_INCLUDE cholmod.h PATH_SUFFIXES suitesparse REQUIRED)
find_library(CHOLMOD_LIBRARY cholmod REQUIRED)
add_library(trocar_cholmod INTERFACE)
target_include_directories(trocar_cholmod SYSTEM INTERFACE ${CHOLMOD_INCLUDE})
# gomp: the OpenMP runtime of GCC that CHOLMOD runs on, by name because FindOpenMP gives clang another
# one; server/lab/finite_elements/sparse_factors.cpp has to tell it something.
target_link_libraries(trocar_cholmod INTERFACE Eigen3::Eigen ${CHOLMOD_LIBRARY} gomp)
