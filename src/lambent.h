/* lambent for C and for everything that calls C: opens a baked file, sets a light, relights.
 *
 *   lambent_file* file = NULL;
 *   lambent_relighter* relighter = NULL;
 *   if (lambent_open("baked.glb", &file) || lambent_relighter_new(file, 0, &relighter) ||
 *       lambent_set_sky(relighter, 35, 45, 3, 0.2f, 1, NULL) || lambent_relight(relighter, rgb, floats, 3))
 *     puts(lambent_error());
 *   lambent_relighter_free(relighter);
 *   lambent_close(file);
 *
 * Every function that can fail returns a code, LAMBENT_OK (0) or another, and then lambent_error() says in a line what
 * was wrong. No exception leaves a function. Null handles and null results are answered by LAMBENT_NULL.
 *
 * Threads: a file may be read, and relighters made of it, by any number of threads at once. A relighter belongs to one
 * thread at a time. lambent_error() is of the calling thread. Relighting itself works on all cores, or as many as
 * lambent_set_threads() allows.
 *
 * Conventions (docs/conventions.md): axes are right-handed with +Y up, in metres; colours are linear Rec. 709; matrices
 * are column after column; radiance of the sky model is in units of 10,000 cd/m^2. */
#ifndef LAMBENT_H
#define LAMBENT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** What a function returns. */
typedef enum lambent_code {
  LAMBENT_OK = 0,          /**< done */
  LAMBENT_NULL = 1,        /**< a handle, or a pointer that must not be null, was null */
  LAMBENT_ARGUMENT = 2,    /**< a size, index or number was out of range */
  LAMBENT_UNREADABLE = 3,  /**< there is no such file, or it cannot be read */
  LAMBENT_BROKEN = 4,      /**< not a baked file, or one that is cut short or broken */
  LAMBENT_NEWER = 5,       /**< a baked file of a newer version than this library reads */
  LAMBENT_UNSUPPORTED = 6, /**< the file's kind of transfer does not have this */
  LAMBENT_NO_LIGHT = 7,    /**< the transfer is for light that was not set yet */
  LAMBENT_MEMORY = 8,      /**< out of memory */
  LAMBENT_INTERNAL = 9     /**< a fault of the library */
} lambent_code;

/** A baked file: it does not change once it is open. */
typedef struct lambent_file lambent_file;
/** Relights one field of a file; keeps the file's data alive by itself. */
typedef struct lambent_relighter lambent_relighter;

/** "0.1.0". */
const char* lambent_version(void);
/** What went wrong in the last call of this thread that failed, in one line; "" where none did. Valid until the next
 * call that fails in this thread. */
const char* lambent_error(void);

/** Threads that relighting uses at most, in the whole process; 0: all cores. */
lambent_code lambent_set_threads(int threads);
/** Threads that it uses at present. */
int lambent_threads(void);

/** Opens a baked file (.glb). Its data are mapped, not copied, so it must not be written to while it is open.
 * Errors: LAMBENT_UNREADABLE, LAMBENT_BROKEN, LAMBENT_NEWER. */
lambent_code lambent_open(const char* path, lambent_file** file);
/** The same from memory, which is copied. Errors: LAMBENT_BROKEN, LAMBENT_NEWER. */
lambent_code lambent_open_memory(const void* bytes, size_t size, lambent_file** file);
/** Null is fine. Relighters made of the file go on working. */
void lambent_close(lambent_file* file);

/** What a field of a file is. Texts live as long as the file. */
typedef struct lambent_info {
  size_t size;           /**< set by the caller, to sizeof(lambent_info) */
  const char* store;     /**< how: "dense", "clusters", "lobes", "factors", "blocks", "surfels", "wavelets" */
  const char* placement; /**< where: "vertices", "texels", "patches", "lattice", "pixels" or "shells" */
  const char* meaning;   /**< of the rows: "diffuse", "directional", "outgoing", "incident", "pixels" or "sight" */
  const char* rows_are;  /**< of directional and outgoing rows, which: "sh:2", "hl2", "map", ...; else "" */
  size_t receivers;      /**< places that receive light */
  size_t rows;           /**< colours that relighting gives for each */
  size_t columns;        /**< coefficients of light: harmonics, then lobes, groups of lamps; 0 of blocks, wavelets */
  size_t values;         /**< floats that lambent_read() gives of a receiver; 0 of blocks */
  size_t parts;          /**< triangle primitives that have receivers */
  int channels;          /**< 1: the same transfer for red, green and blue; 3: one for each */
  int sh_order;          /**< bands of harmonics: the first sh_order^2 columns */
  int lobes;             /**< columns that are lobes */
  int groups;            /**< columns that are lamps of the scene, by group */
  int width;             /**< of an atlas or a picture, texels or pixels; else 0 */
  int height;            /**< the same */
  float box_min[3];      /**< of a lattice: its least corner, metres; else 0 */
  float box_max[3];      /**< and its greatest */
  int points[3];         /**< of a lattice: points along x, y, z, x fastest; of shells: twice side, how many; else 0 */
} lambent_info;

/** How many fields a file has: 0 is the surface's, then light in free space (a lattice) where it was baked. */
lambent_code lambent_fields(const lambent_file* file, size_t* count);
/** Errors: LAMBENT_ARGUMENT: a field that is not there, or info->size not set. */
lambent_code lambent_describe(const lambent_file* file, size_t field, lambent_info* info);

/** No receiver: this side of a vertex, triangle or texel receives nothing. */
#define LAMBENT_NO_RECEIVER 0xffffffffu

/** A triangle primitive of the file's scene. Arrays live as long as the file. */
typedef struct lambent_part {
  size_t size;           /**< set by the caller, to sizeof(lambent_part) */
  int node;              /**< index of the node in the glTF */
  int primitive;         /**< index of the primitive within the node's mesh */
  size_t count;          /**< vertices; where placement is "patches", triangles */
  const uint32_t* front; /**< receiver of each, on the side from which it is counter-clockwise; null of texels */
  const uint32_t* back;  /**< on the other side; null also where the whole scene is one-sided */
  const float* front_uv; /**< of texels: place of each vertex in the atlas, in texels, (x, y); else null */
  const float* back_uv;  /**< on the other side */
} lambent_part;

/** Of the surface. Errors: LAMBENT_ARGUMENT: a part that is not there, or part->size not set. */
lambent_code lambent_get_part(const lambent_file* file, size_t index, lambent_part* part);
/** The receiver of each texel of the atlas, row by row, width x height of them. Errors: LAMBENT_UNSUPPORTED: receivers
 * are elsewhere. */
lambent_code lambent_get_texels(const lambent_file* file, const uint32_t** receivers);
/** Name of a group of lamps, 0 to groups - 1. Errors: LAMBENT_ARGUMENT. */
lambent_code lambent_get_group(const lambent_file* file, size_t index, const char** name);
/** The transfer itself: the info's `values` floats of one receiver, [row][channel][column] of dense and clustered
 * transfer; of lobes as transfer/zonal_transfer.h has them; of wavelets a coefficient a column. Errors:
 * LAMBENT_ARGUMENT: index or size; LAMBENT_UNSUPPORTED: blocks. */
lambent_code lambent_read(const lambent_file* file, size_t field, size_t receiver, float* values, size_t count);

/** For a field of the file. Errors: LAMBENT_ARGUMENT: a field that is not there; LAMBENT_UNSUPPORTED: visibility in
 * blocks, which needs materials: lambent_relighter_new_blocks(). */
lambent_code lambent_relighter_new(const lambent_file* file, size_t field, lambent_relighter** relighter);

/** How a surface reflects. */
typedef enum lambent_model {
  LAMBENT_LAMBERT = 0,           /**< evenly: base_color over pi; the rest is not looked at */
  LAMBENT_METALLIC_ROUGHNESS = 1 /**< glTF's */
} lambent_model;
/** A material of a surface whose last reflection is free. */
typedef struct lambent_material {
  int model;           /**< of lambent_model */
  float base_color[3]; /**< [0, 1], linear */
  float metallic;      /**< [0, 1] */
  float roughness;     /**< [0, 1] */
} lambent_material;
/** For visibility in blocks: light, view and materials meet when it is relit. `positions` and `normals` (unit) are x,
 * y, z of each receiver as it was baked, `receivers` of them: those of its vertex (lambent_get_part()), the normal
 * towards its side. Material of receiver r is materials[material_of[r]]; material_of null: the first for all. All is
 * copied. Errors: LAMBENT_ARGUMENT: a number of receivers other than the field's, a material that is not there or out
 * of range, numbers that are not finite, normals that are not unit; LAMBENT_UNSUPPORTED: another kind of transfer. */
lambent_code lambent_relighter_new_blocks(const lambent_file* file, size_t field, const float* positions,
                                          const float* normals, size_t receivers, const lambent_material* materials,
                                          size_t material_count, const uint32_t* material_of,
                                          lambent_relighter** relighter);
/** Where blocks are seen from, x, y, z; the origin until told otherwise. Errors: LAMBENT_ARGUMENT: not finite;
 * LAMBENT_UNSUPPORTED: other transfer than blocks looks alike from everywhere, or leaves the view to
 * the last reflection. */
lambent_code lambent_set_eye(lambent_relighter* relighter, const float* eye);
/** Null is fine. */
void lambent_relighter_free(lambent_relighter* relighter);

/** Light as it multiplies the columns: `count` = columns times r, g, b. Errors: LAMBENT_ARGUMENT; LAMBENT_UNSUPPORTED:
 * blocks and wavelets take an environment. */
lambent_code lambent_set_columns(lambent_relighter* relighter, const float* rgb, size_t count);

/** Whose spherical harmonics coefficients are (docs/conventions.md). All are indexed l(l+1)+m. */
typedef enum lambent_sh {
  LAMBENT_SH_LAMBENT = 0, /**< radiance, with the Condon-Shortley sign: also Sloan, DirectXMath, Unreal, Babylon */
  LAMBENT_SH_THREE = 1,   /**< three.js: radiance, without the sign */
  LAMBENT_SH_UNITY = 2,   /**< irradiance times the basis's constants over pi; order 3 at most */
  LAMBENT_SH_GODOT = 3,   /**< radiance over pi, without the sign */
  LAMBENT_SH_GLTF = 4     /**< irradiance, with the sign; order 3 at most */
} lambent_sh;
/** Distant light as harmonics of `order` bands, order^2 times r, g, b, of a convention of lambent_sh. Bands that the
 * file lacks are left out, those that are not given are 0, and so are lobes. Errors: LAMBENT_ARGUMENT;
 * LAMBENT_UNSUPPORTED: the file has no harmonics. */
lambent_code lambent_set_sh(lambent_relighter* relighter, const float* rgb, int order, int convention);

/** Distant light as a lat-long picture of radiance, height x width x (r, g, b) from the top: the top row is +Y, the
 * centre +X, three quarters to the right +Z. Projected onto the file's columns, or onto the cube of its blocks
 * or wavelets;
 * `rotation` (3 x 3, null: none) turns the light. Errors: LAMBENT_ARGUMENT: a size, whose width is twice its height but
 * for a pixel, values that are negative or not finite, a matrix that is no rotation; LAMBENT_UNSUPPORTED: the file has
 * no columns for distant light.
 */
lambent_code lambent_set_environment(lambent_relighter* relighter, const float* rgb, int width, int height,
                                     const float* rotation);
/** Distant light as a clear sky (light/sky.h): elevation [-2, 90] and azimuth (from +X towards +Z) of the sun in
 * degrees, turbidity [1.7, 10], ground albedo [0, 1], with its sun or without (0). Errors: as
 * lambent_set_environment(). */
lambent_code lambent_set_sky(lambent_relighter* relighter, float elevation, float azimuth, float turbidity,
                             float ground, int sun, const float* rotation);
/** A group of the scene's lamps by name, times this colour; 1, 1, 1 until told otherwise. Errors: LAMBENT_ARGUMENT: no
 * such group. */
lambent_code lambent_set_lamp(lambent_relighter* relighter, const char* group, const float* rgb);
/** How each receiver has turned since the bake, 3 x 3 each, `receivers` of them; null and 0: as baked. Errors:
 * LAMBENT_ARGUMENT: another number; LAMBENT_UNSUPPORTED: the transfer is not lobes. */
lambent_code lambent_set_rotations(lambent_relighter* relighter, const float* rotations, size_t receivers);

/** T . light: row after row of r, g, b for each receiver, which begins at rgb[receiver * stride]; of diffuse transfer
 * the exit radiance of a white surface, of blocks that of its material towards the eye. `floats` is how many there is
 * room for, stride 3 rows at least. Fastest with one row, stride 3 and memory on a 64-byte boundary. Errors:
 * LAMBENT_ARGUMENT; LAMBENT_NO_LIGHT. */
lambent_code lambent_relight(lambent_relighter* relighter, float* rgb, size_t floats, size_t stride);

#ifdef __cplusplus
}
#endif
#endif
