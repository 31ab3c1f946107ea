// Light in free space that lambent baked, from the grid that LambentLightmap sets: irradiance / pi at a place in the
// world for a normal, to be multiplied by the albedo. Bands 0 and 1, as adaptive probe volumes keep them by default.
#ifndef LAMBENT_PROBES_INCLUDED
#define LAMBENT_PROBES_INCLUDED

Texture3D<float4> _LambentProbesR, _LambentProbesG, _LambentProbesB;
SamplerState sampler_LambentProbesR;
float3 _LambentProbesMin, _LambentProbesMax;

float3 LambentProbeLight(float3 place, float3 normal)
{
    float3 counts;
    _LambentProbesR.GetDimensions(counts.x, counts.y, counts.z);
    float3 share = saturate((place - _LambentProbesMin) / (_LambentProbesMax - _LambentProbesMin));
    float3 at = (share * (counts - 1) + 0.5) / counts; // texels are centred at the grid's points
    float4 n = float4(normal, 1);
    return max(0, float3(dot(_LambentProbesR.SampleLevel(sampler_LambentProbesR, at, 0), n),
                         dot(_LambentProbesG.SampleLevel(sampler_LambentProbesR, at, 0), n),
                         dot(_LambentProbesB.SampleLevel(sampler_LambentProbesR, at, 0), n)));
}

#endif
