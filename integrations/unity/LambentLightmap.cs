// Gives renderers the lightmaps that lambent baked, whenever the scene is opened or loaded: LightmapSettings belong to
// no object that a scene would keep. The menu Tools > lambent (Editor/LambentImporter.cs) fills it in. Unity 2021.3 on.
using System;
using UnityEngine;
using UnityEngine.Rendering;

[ExecuteAlways]
[DefaultExecutionOrder(-1000)]
public sealed class LambentLightmap : MonoBehaviour
{
    [Serializable]
    public struct Lit
    {
        public Renderer renderer;
        public int lightmap;
        public Vector4 scaleOffset;
    }

    public Texture2D[] colors = new Texture2D[0];
    public Texture2D[] directions = new Texture2D[0]; // as many, or none
    public Lit[] objects = new Lit[0];

    // Probes: SphericalHarmonicsL2's numbers, 27 a probe, coefficient by coefficient.
    public float[] probes = new float[0];
    public Vector3 gridMin, gridMax;
    public Texture3D gridRed, gridGreen, gridBlue; // LambentProbes.hlsl

    void OnEnable()
    {
        Apply();
    }

    // Lightmaps that are there already stay, and keep their indices.
    public void Apply()
    {
        if (colors.Length == 0)
            return;
        bool directional = directions.Length == colors.Length;
        LightmapData[] before = LightmapSettings.lightmaps;
        int first = Array.FindIndex(before, map => map != null && map.lightmapColor == colors[0]);
        if (first < 0)
            first = before.Length;
        var all = new LightmapData[Mathf.Max(before.Length, first + colors.Length)];
        Array.Copy(before, all, before.Length);
        for (int i = 0; i < colors.Length; ++i)
            all[first + i] = new LightmapData
            {
                lightmapColor = colors[i], lightmapDir = directional ? directions[i] : null
            };
        LightmapSettings.lightmapsMode =
            directional ? LightmapsMode.CombinedDirectional : LightmapsMode.NonDirectional;
        LightmapSettings.lightmaps = all;
        foreach (Lit lit in objects)
        {
            if (lit.renderer == null)
                continue;
            lit.renderer.lightmapIndex = first + lit.lightmap;
            lit.renderer.lightmapScaleOffset = lit.scaleOffset;
        }
        if (gridRed != null)
        {
            Shader.SetGlobalTexture("_LambentProbesR", gridRed);
            Shader.SetGlobalTexture("_LambentProbesG", gridGreen);
            Shader.SetGlobalTexture("_LambentProbesB", gridBlue);
            Shader.SetGlobalVector("_LambentProbesMin", gridMin);
            Shader.SetGlobalVector("_LambentProbesMax", gridMax);
        }
        ApplyProbes();
    }

    // False where the scene's own probes are others, or not made yet (Lighting > Generate Lighting makes them from the
    // LightProbeGroup): then renderers keep Unity's, and shaders may use the grid.
    public bool ApplyProbes()
    {
        LightProbes there = LightmapSettings.lightProbes;
        int count = probes.Length / 27;
        if (count == 0 || there == null || there.count != count)
            return false;
        var values = new SphericalHarmonicsL2[count];
        for (int i = 0; i < count; ++i)
            for (int k = 0; k < 9; ++k)
                for (int channel = 0; channel < 3; ++channel)
                    values[i][channel, k] = probes[27 * i + 3 * k + channel];
        there.bakedProbes = values;
        return true;
    }
}
