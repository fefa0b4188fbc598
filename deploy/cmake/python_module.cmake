# The Python module needs position-independent code of every library it is made of. Inlining stays as
# it is without: no other library may put its own functions in the place of ours.
if(TROCAR_PYTHON)
  # Debian's own, for which pybind11 and numpy are packaged; another may come first on PATH.
  set(Python_EXECUTABLE "/usr/bin/python3" CACHE FILEPATH "Python that the module is for")
  find_package(Python 3.9 COMPONENTS Interpreter Development.Module NumPy)
  find_package(pybind11 2.9 CONFIG)
  if(NOT Python_FOUND OR NOT pybind11_FOUND)
    message(STATUS "No Python module: pybind11, numpy or Python's headers are missing (python3-dev pybind11-dev python3-numpy)")
    set(TROCAR_PYTHON OFF)
  endif()
endif()
if(TROCAR_PYTHON)
  set(CMAKE_POSITION_INDEPENDENT_CODE ON)
  add_compile_options(-fvisibility=hidden -fno-semantic-interposition)
endif()
