// One lightmap under any sky, for Unity (HLSL, ShaderLab's HLSLPROGRAM): the sum of pictures PREFIX.sky.K.exr (a
// Texture2DArray of them, slice K), each by the sky's coefficient K (`lambent env SKY --order N --json`, or
// PREFIX.sky.json), is irradiance / pi: to be multiplied by the albedo and added as emission.
#ifndef LAMBENT_SKY_INCLUDED
#define LAMBENT_SKY_INCLUDED

Texture2DArray<float4> _LambentSky;
SamplerState sampler_LambentSky;
float4 _LambentSkyCoefficients[9]; // material.SetVectorArray

float3 LambentSkyLight(float2 uv2)
{
    float3 sum = 0;
    for (int k = 0; k < 9; ++k)
        sum += _LambentSkyCoefficients[k].rgb * _LambentSky.Sample(sampler_LambentSky, float3(uv2, k)).rgb;
    return max(sum, 0);
}

#endif
