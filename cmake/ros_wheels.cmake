# ROS 2 from wheels: the exported `*__rosidl_generator_py` targets name include directories of the
# machine that built the wheel, and CMake refuses a target whose include directory does not exist.
# This drops the directories that are not there. On a system ROS every directory exists: nothing changes.
#
# Handed to each CMake package by ros2_ws/colcon.meta. It runs when the package's own CMakeLists.txt
# has been read to its end, because rosidl finds more packages on the way.

function(fbql_drop_missing_include_directories)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(directories "${target}" INTERFACE_INCLUDE_DIRECTORIES)
    if(NOT directories)
      continue()
    endif()
    set(existing)
    foreach(directory IN LISTS directories)
      if(directory MATCHES "\\$<" OR EXISTS "${directory}")
        list(APPEND existing "${directory}")
      endif()
    endforeach()
    set_target_properties("${target}" PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${existing}")
  endforeach()
endfunction()

cmake_language(DEFER CALL fbql_drop_missing_include_directories)
