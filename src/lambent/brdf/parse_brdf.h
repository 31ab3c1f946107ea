#pragma once
// Reflection models as text, as the command line takes them.
#include <lambent/brdf/brdf.h>
#include <lambent/core/result.h>

#include <string>
#include <string_view>

namespace lambent {

// NAME or NAME:key=value,key=value. A colour is one number or three, R,G,B; so is a width one number or two, along x
// and y.
//   lambert:albedo=0.8
//   phong:exponent=8,diffuse=0.2,specular=0.7
//   ggx:roughness=0.3,f0=0.9                     roughness^2 is alpha; one or two numbers
//   cook-torrance:roughness=0.3,f0=0.5,diffuse=0.2,specular=0.8      roughness is m
//   ward:ax=0.1,ay=0.3,diffuse=0.2,specular=0.7
//   metallic-roughness:color=0.8,metallic=0,roughness=0.5
//   measured:FILE                                what load_measured() reads; FILE may contain commas
// What is left out has the value shown in brdf.h. Errors: unknown name or key; a key twice; not a number; out of range
// (colours and roughness [0, 1], exponent [0, 1e5], widths [0, 1]; diffuse + specular above 1 in any channel); what
// load_measured() refuses.
Result<Brdf> parse_brdf(std::string_view text);

// One line that the help of a command prints.
inline constexpr const char* brdf_syntax =
    "lambert:albedo=R,G,B  phong:exponent=N,diffuse=,specular=  ggx:roughness=,f0=  "
    "cook-torrance:roughness=,f0=,diffuse=,specular=  "
    "ward:ax=,ay=,diffuse=,specular=  metallic-roughness:color=,metallic=,roughness=  measured:FILE";

}  // namespace lambent
