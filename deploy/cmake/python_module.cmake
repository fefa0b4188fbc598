# The Python module is made of the same libraries as the programs, so these are position-independent.
# Hidden, and with -fno-semantic-interposition, a function is still called directly and inlined: nobody
# can put another in its place. Programs are compiled so, too: one precompiled header serves all.
set(TROCAR_POSITION_INDEPENDENT_OPTIONS -fvisibility=hidden -fno-semantic-interposition)
function(make_position_independent target)
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_compile_options(${target} PRIVATE ${TROCAR_POSITION_INDEPENDENT_OPTIONS})
endfunction()

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
# Nothing where the module is not built.
add_custom_target(python_module)
