// Tools > lambent > Use lightmaps of...: reads PREFIX.unity.json, as `lambent export BAKED.glb --unity PREFIX` writes
// it, sets how its pictures are imported, finds the objects by name in the open scene and hands all of it to a
// LambentLightmap. Project settings: Player > Other Settings > Lightmap Encoding: High Quality (pictures are linear
// and go beyond 1). Unity 2021.3 on.
using System;
using System.Collections.Generic;
using System.IO;
using UnityEditor;
using UnityEditor.SceneManagement;
using UnityEngine;
using UnityEngine.SceneManagement;

public static class LambentImporter
{
    [Serializable]
    class Map
    {
        public string color = "";
        public string direction = "";
    }

    [Serializable]
    class Named
    {
        public string name = "";
        public int lightmap = 0;
        public float[] scaleOffset = new float[0];
    }

    [Serializable]
    class Grid
    {
        public int[] counts = new int[0];
        public float[] min = new float[0];
        public float[] max = new float[0];
        public float[] positions = new float[0];
        public float[] sh = new float[0];
    }

    [Serializable]
    class Manifest
    {
        public int version = 0;
        public bool directional = false;
        public Map[] lightmaps = new Map[0];
        public Named[] objects = new Named[0];
        public Grid probes = new Grid();
    }

    [Serializable]
    class Sky
    {
        public int order = 0;
        public string[] pictures = new string[0];
        public string[] objects = new string[0];
    }

    // PREFIX.sky.json: a Texture2DArray for LambentSky.hlsl, PREFIX.sky.asset, or one for each object.
    [MenuItem("Tools/lambent/Make sky columns of...")]
    static void ChooseSky()
    {
        string path = EditorUtility.OpenFilePanel("PREFIX.sky.json", Application.dataPath, "json");
        if (!string.IsNullOrEmpty(path) && path.StartsWith(Application.dataPath, StringComparison.Ordinal))
            MakeSky("Assets" + path.Substring(Application.dataPath.Length));
    }

    public static void MakeSky(string path)
    {
        Sky sky = JsonUtility.FromJson<Sky>(File.ReadAllText(path));
        string folder = Path.GetDirectoryName(path).Replace('\\', '/') + "/";
        string[] endings = sky.objects.Length == 0 ? new[] { "" } : Array.ConvertAll(sky.objects, o => "." + o);
        foreach (string ending in endings)
        {
            Texture2DArray all = null;
            for (int k = 0; k < sky.pictures.Length; ++k)
            {
                Texture2D one = Import(folder + sky.pictures[k] + ending + ".exr", TextureImporterType.Default);
                if (all == null)
                    all = new Texture2DArray(one.width, one.height, sky.pictures.Length, TextureFormat.RGBAHalf, false);
                Graphics.CopyTexture(one, 0, 0, all, k, 0);
            }
            all.wrapMode = TextureWrapMode.Clamp;
            AssetDatabase.CreateAsset(all, folder + Path.GetFileNameWithoutExtension(path) + ending + ".asset");
        }
    }

    [MenuItem("Tools/lambent/Use lightmaps of...")]
    static void Choose()
    {
        string path = EditorUtility.OpenFilePanel("PREFIX.unity.json", Application.dataPath, "json");
        if (string.IsNullOrEmpty(path))
            return;
        if (!path.StartsWith(Application.dataPath, StringComparison.Ordinal))
            Debug.LogError("lambent: " + path + " lies outside of the project's Assets");
        else
            Use("Assets" + path.Substring(Application.dataPath.Length));
    }

    // From code, too: LambentImporter.Use("Assets/light/room.unity.json").
    public static LambentLightmap Use(string path)
    {
        Manifest manifest = JsonUtility.FromJson<Manifest>(File.ReadAllText(path));
        if (manifest == null || manifest.version != 1)
        {
            Debug.LogError("lambent: " + path + " is no manifest of an export, or a newer one");
            return null;
        }
        string folder = Path.GetDirectoryName(path).Replace('\\', '/') + "/";
        Scene scene = SceneManager.GetActiveScene();
        LambentLightmap light = UnityEngine.Object.FindObjectOfType<LambentLightmap>();
        if (light == null)
            light = new GameObject("Lambent light").AddComponent<LambentLightmap>();
        light.colors = new Texture2D[manifest.lightmaps.Length];
        light.directions = new Texture2D[manifest.directional ? manifest.lightmaps.Length : 0];
        for (int i = 0; i < manifest.lightmaps.Length; ++i)
        {
            light.colors[i] = Import(folder + manifest.lightmaps[i].color, TextureImporterType.Lightmap);
            if (manifest.directional)
                light.directions[i] = Import(folder + manifest.lightmaps[i].direction, TextureImporterType.Default);
        }
        Find(light, manifest, scene);
        if (manifest.probes.counts.Length == 3)
            Probes(light, manifest.probes, folder, Path.GetFileNameWithoutExtension(path));
        light.Apply();
        EditorUtility.SetDirty(light);
        EditorSceneManager.MarkSceneDirty(scene);
        return light;
    }

    // Linear, to its edges, without mip-maps; directions in half floats, since their alpha counts.
    static Texture2D Import(string path, TextureImporterType type)
    {
        AssetDatabase.ImportAsset(path);
        var importer = (TextureImporter)AssetImporter.GetAtPath(path);
        importer.textureType = type;
        importer.sRGBTexture = false;
        importer.alphaIsTransparency = false;
        importer.wrapMode = TextureWrapMode.Clamp;
        importer.mipmapEnabled = false;
        importer.npotScale = TextureImporterNPOTScale.None;
        importer.maxTextureSize = 16384;
        if (type == TextureImporterType.Default)
        {
            TextureImporterPlatformSettings settings = importer.GetDefaultPlatformTextureSettings();
            settings.format = TextureImporterFormat.RGBAHalf;
            settings.maxTextureSize = 16384;
            importer.SetPlatformTextureSettings(settings);
        }
        importer.SaveAndReimport();
        return AssetDatabase.LoadAssetAtPath<Texture2D>(path);
    }

    static void Find(LambentLightmap light, Manifest manifest, Scene scene)
    {
        var byName = new Dictionary<string, List<Renderer>>();
        foreach (GameObject root in scene.GetRootGameObjects())
            foreach (MeshRenderer renderer in root.GetComponentsInChildren<MeshRenderer>(true))
            {
                // A glTF mesh of several primitives may become children of the node's object.
                foreach (Transform t in new[] { renderer.transform, renderer.transform.parent })
                {
                    if (t == null)
                        continue;
                    if (!byName.ContainsKey(t.name))
                        byName[t.name] = new List<Renderer>();
                    byName[t.name].Add(renderer);
                }
            }
        var lit = new List<LambentLightmap.Lit>();
        var taken = new HashSet<Renderer>();
        var missing = new List<string>();
        foreach (Named named in manifest.objects)
        {
            if (!byName.TryGetValue(named.name, out List<Renderer> renderers))
            {
                missing.Add(named.name);
                continue;
            }
            foreach (Renderer renderer in renderers)
                if (taken.Add(renderer))
                    lit.Add(new LambentLightmap.Lit
                    {
                        renderer = renderer,
                        lightmap = named.lightmap,
                        scaleOffset = new Vector4(named.scaleOffset[0], named.scaleOffset[1], named.scaleOffset[2],
                            named.scaleOffset[3])
                    });
        }
        light.objects = lit.ToArray();
        if (missing.Count > 0)
            Debug.LogWarning("lambent: not in this scene: " + string.Join(", ", missing));
    }

    // A LightProbeGroup at the grid's points, whose values Apply() sets once Unity has made its probes, and the grid
    // as three pictures of four numbers a point (bands 0 and 1), as adaptive probe volumes keep them.
    static void Probes(LambentLightmap light, Grid grid, string folder, string name)
    {
        int count = grid.positions.Length / 3;
        var points = new Vector3[count];
        for (int i = 0; i < count; ++i)
            points[i] = new Vector3(grid.positions[3 * i], grid.positions[3 * i + 1], grid.positions[3 * i + 2]);
        LightProbeGroup group = light.GetComponent<LightProbeGroup>();
        if (group == null)
            group = light.gameObject.AddComponent<LightProbeGroup>();
        group.probePositions = points;
        light.probes = grid.sh;
        light.gridMin = new Vector3(grid.min[0], grid.min[1], grid.min[2]);
        light.gridMax = new Vector3(grid.max[0], grid.max[1], grid.max[2]);
        Texture3D[] pictures = new Texture3D[3];
        for (int channel = 0; channel < 3; ++channel)
        {
            int nx = grid.counts[0], ny = grid.counts[1], nz = grid.counts[2];
            var values = new Color[count];
            for (int i = 0; i < count; ++i)
            {
                // The grid's x runs the other way in Unity's space.
                int x = i % nx, rest = i / nx;
                values[rest * nx + (nx - 1 - x)] = new Color(grid.sh[27 * i + 9 + channel],
                    grid.sh[27 * i + 3 + channel], grid.sh[27 * i + 6 + channel], grid.sh[27 * i + channel]);
            }
            pictures[channel] = new Texture3D(nx, ny, nz, TextureFormat.RGBAHalf, false);
            pictures[channel].wrapMode = TextureWrapMode.Clamp;
            pictures[channel].SetPixels(values);
            pictures[channel].Apply();
            AssetDatabase.CreateAsset(pictures[channel], folder + name + "." + "rgb"[channel] + ".asset");
        }
        light.gridRed = pictures[0];
        light.gridGreen = pictures[1];
        light.gridBlue = pictures[2];
        if (!light.ApplyProbes())
            Debug.Log("lambent: the scene has no probes of this grid yet: Lighting > Generate Lighting makes them, " +
                "then Tools > lambent again");
    }
}
