@tool
extends EditorScript
## Puts a LightmapGI with lambent's light into the scene that is open: File > Run in the script editor (Godot 4.3 to
## 4.6). It reads every *.godot.json beside it, as `lambent export BAKED.glb --godot PREFIX` writes them. The scene is
## PREFIX.godot.glb, as it is or instanced; objects are found by their names, wherever they stand.
##
## From code: attach(root, "res://light/room.godot.json") gives the LightmapGI, or null.


func _run() -> void:
	var root := get_scene()
	if root == null:
		push_error("lambent: no scene is open")
		return
	var folder: String = get_script().resource_path.get_base_dir()
	var found := 0
	for file in DirAccess.get_files_at(folder):
		if file.ends_with(".godot.json"):
			found += 1
			attach(root, folder.path_join(file))
	if found == 0:
		push_error("lambent: no *.godot.json beside the script, in " + folder)


static func attach(root: Node, path: String) -> LightmapGI:
	var manifest: Variant = JSON.parse_string(FileAccess.get_file_as_string(path))
	if not manifest is Dictionary or not manifest.has("data") or not manifest.has("users"):
		push_error("lambent: " + path + " is no manifest of an export")
		return null
	var stored := path.get_base_dir().path_join(manifest["data"])
	var data: LightmapGIData = ResourceLoader.load(stored, "LightmapGIData")
	if data == null:
		push_error("lambent: " + stored + " cannot be loaded")
		return null
	var light := root.get_node_or_null("LambentLight") as LightmapGI
	if light == null:
		light = LightmapGI.new()
		light.name = "LambentLight"
		root.add_child(light)
		light.owner = root
	light.light_data = null  # it is given back below, so that the renderer hears of its users
	var meshes := {}
	_collect(root, meshes)
	data.clear_users()
	var missing := PackedStringArray()
	for user in manifest["users"]:
		if not meshes.has(user["name"]):
			missing.append(user["name"])
			continue
		var mesh: MeshInstance3D = meshes[user["name"]]
		mesh.gi_mode = GeometryInstance3D.GI_MODE_STATIC
		var r: Array = user["rect"]
		data.add_user(light.get_path_to(mesh), Rect2(r[0], r[1], r[2], r[3]), int(user["slice"]), -1)
	light.light_data = data
	ResourceSaver.save(data, stored)
	if not missing.is_empty():
		push_warning("lambent: not in this scene: " + ", ".join(missing))
	print("lambent: ", data.get_user_count(), " of ", manifest["users"].size(), " objects lit by ", stored)
	return light


static func _collect(node: Node, meshes: Dictionary) -> void:
	if node is MeshInstance3D and not meshes.has(String(node.name)):
		meshes[String(node.name)] = node
	for child in node.get_children():
		_collect(child, meshes)
