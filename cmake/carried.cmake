# Files of integrations/ that the tool carries and `lambent export` writes beside what they read.
set(carried_files godot/lambent_lightmap.gd unity/LambentLightmap.cs unity/LambentProbes.hlsl unity/LambentImporter.cs
  shaders/lambent_sky.gdshaderinc shaders/LambentSky.hlsl shaders/lambent_sky.glsl three/lambent_probes.js)
set(carried_source ${CMAKE_CURRENT_BINARY_DIR}/carried_files.cpp)
set(carried_text "#include \"lightmap_writer.h\"\n\nnamespace lambent::tool {\n\n")
string(APPEND carried_text "const char* carried_file(const std::string& name) {\n")
foreach(file ${carried_files})
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/integrations/${file})
  file(READ integrations/${file} text)
  string(APPEND carried_text "  if (name == \"${file}\") return R\"=carried=(${text})=carried=\";\n")
endforeach()
string(APPEND carried_text "  return nullptr;\n}\n\n}  // namespace lambent::tool\n")
file(CONFIGURE OUTPUT ${carried_source} CONTENT "${carried_text}" @ONLY)
target_sources(lambent-tool PRIVATE ${carried_source})
set_source_files_properties(${carried_source} PROPERTIES INCLUDE_DIRECTORIES ${CMAKE_CURRENT_SOURCE_DIR}/apps/lambent
  SKIP_UNITY_BUILD_INCLUSION ON)
