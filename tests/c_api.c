/* lambent.h from C99: what is refused, and by which code. Values are checked in src/lambent/c/lambent_test.cpp.
 *   c_api FOLDER_OF_GOLDEN_FILES */
#include <lambent.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures = 0;
static void check(int condition, int line, const char* text) {
  if (condition) return;
  printf("line %d: %s (last error: %s)\n", line, text, lambent_error());
  ++failures;
}
#define CHECK(condition) check((condition), __LINE__, #condition)

static unsigned char* read_whole(const char* path, size_t* size) {
  unsigned char* bytes;
  long length;
  FILE* f = fopen(path, "rb");
  if (!f) return NULL;
  fseek(f, 0, SEEK_END);
  length = ftell(f);
  rewind(f);
  bytes = malloc((size_t)length);
  *size = fread(bytes, 1, (size_t)length, f);
  fclose(f);
  return bytes;
}

static void null_handles(void) {
  lambent_file* file = NULL;
  lambent_relighter* relighter = NULL;
  lambent_info info;
  lambent_part part;
  const uint32_t* texels;
  const char* name;
  size_t count;
  float rgb[3] = {1, 1, 1};
  info.size = sizeof info, part.size = sizeof part;
  CHECK(lambent_open(NULL, &file) == LAMBENT_NULL && lambent_open("a", NULL) == LAMBENT_NULL);
  CHECK(lambent_open_memory(NULL, 4, &file) == LAMBENT_NULL && lambent_open_memory("a", 1, NULL) == LAMBENT_NULL);
  CHECK(lambent_fields(NULL, &count) == LAMBENT_NULL && lambent_describe(NULL, 0, &info) == LAMBENT_NULL);
  CHECK(lambent_get_part(NULL, 0, &part) == LAMBENT_NULL && lambent_get_texels(NULL, &texels) == LAMBENT_NULL);
  CHECK(lambent_get_group(NULL, 0, &name) == LAMBENT_NULL && lambent_read(NULL, 0, 0, rgb, 3) == LAMBENT_NULL);
  CHECK(lambent_relighter_new(NULL, 0, &relighter) == LAMBENT_NULL);
  CHECK(lambent_set_columns(NULL, rgb, 1) == LAMBENT_NULL && lambent_set_sh(NULL, rgb, 1, 0) == LAMBENT_NULL);
  CHECK(lambent_set_environment(NULL, rgb, 1, 1, NULL) == LAMBENT_NULL);
  CHECK(lambent_set_sky(NULL, 30, 0, 3, 0, 1, NULL) == LAMBENT_NULL);
  CHECK(lambent_set_lamp(NULL, "a", rgb) == LAMBENT_NULL);
  CHECK(lambent_set_rotations(NULL, rgb, 0) == LAMBENT_NULL && lambent_relight(NULL, rgb, 3, 3) == LAMBENT_NULL);
  CHECK(strlen(lambent_error()) > 0);
  lambent_close(NULL);
  lambent_relighter_free(NULL);
}

static void wrong_arguments(const char* path) {
  lambent_file* file = NULL;
  lambent_relighter* r = NULL;
  lambent_info info;
  lambent_part part;
  const char* name;
  const uint32_t* texels;
  size_t floats;
  float *light, *out;
  const float skew[9] = {1, 0, 0, 0, 1, 0, 0.5f, 0, 1}, mirror[9] = {-1, 0, 0, 0, 1, 0, 0, 0, 1};
  const float negative[3] = {1, -1, 1};
  float not_finite[3] = {1, 1, 1};
  not_finite[1] = (float)NAN;
  info.size = 0, part.size = 0;
  CHECK(lambent_open(path, &file) == LAMBENT_OK);
  CHECK(lambent_describe(file, 0, &info) == LAMBENT_ARGUMENT && lambent_get_part(file, 0, &part) == LAMBENT_ARGUMENT);
  info.size = sizeof info, part.size = sizeof part;
  CHECK(lambent_describe(file, 0, &info) == LAMBENT_OK && lambent_describe(file, 9, &info) == LAMBENT_ARGUMENT);
  CHECK(lambent_get_part(file, info.parts, &part) == LAMBENT_ARGUMENT);
  CHECK(lambent_get_texels(file, &texels) == LAMBENT_UNSUPPORTED);
  CHECK(lambent_get_group(file, 0, &name) == LAMBENT_ARGUMENT);
  CHECK(lambent_relighter_new(file, 9, &r) == LAMBENT_ARGUMENT && r == NULL);
  CHECK(lambent_relighter_new(file, 0, &r) == LAMBENT_OK);
  light = calloc(3 * info.columns, sizeof *light);
  floats = 3 * info.rows * info.receivers;
  out = calloc(floats, sizeof *out);
  CHECK(lambent_read(file, 0, info.receivers, out, info.values) == LAMBENT_ARGUMENT);
  CHECK(lambent_read(file, 0, 0, out, info.values + 1) == LAMBENT_ARGUMENT);
  CHECK(lambent_relight(r, out, floats, 3 * info.rows) == LAMBENT_NO_LIGHT);
  CHECK(lambent_set_columns(r, light, info.columns + 1) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_sh(r, light, 0, LAMBENT_SH_LAMBENT) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_sh(r, light, 17, LAMBENT_SH_LAMBENT) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_sh(r, light, 4, LAMBENT_SH_UNITY) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_sh(r, light, 2, 77) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_sh(r, not_finite, 1, LAMBENT_SH_LAMBENT) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_environment(r, negative, 1, 1, NULL) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_environment(r, not_finite, 1, 1, NULL) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_environment(r, light, 0, 1, NULL) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_environment(r, light, 1 << 20, 1 << 20, NULL) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_environment(r, light, 1, 1, skew) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_environment(r, light, 1, 1, mirror) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_sky(r, 200, 0, 3, 0.2f, 1, NULL) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_lamp(r, "nobody", light) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_rotations(r, skew, 1) == LAMBENT_UNSUPPORTED && lambent_set_eye(r, skew) == LAMBENT_UNSUPPORTED);
  CHECK(lambent_relighter_new_blocks(file, 0, skew, skew, 3, NULL, 0, NULL, &r) == LAMBENT_NULL);
  CHECK(lambent_set_columns(r, light, info.columns) == LAMBENT_OK);
  CHECK(lambent_relight(r, out, floats - 1, 3 * info.rows) == LAMBENT_ARGUMENT);
  CHECK(lambent_relight(r, out, floats, 3 * info.rows - 1) == LAMBENT_ARGUMENT);
  CHECK(lambent_relight(r, out, floats, (size_t)-1) == LAMBENT_ARGUMENT);
  CHECK(lambent_relight(r, out, floats, 3 * info.rows) == LAMBENT_OK);
  CHECK(lambent_set_threads(-1) == LAMBENT_ARGUMENT && lambent_set_threads(1) == LAMBENT_OK && lambent_threads() == 1);
  CHECK(lambent_set_threads(0) == LAMBENT_OK && lambent_threads() >= 1);
  free(light);
  free(out);
  lambent_relighter_free(r);
  lambent_close(file);
}

static void wrong_blocks(const lambent_file* file) {
  lambent_relighter* r = NULL;
  lambent_info info;
  lambent_material material = {LAMBENT_LAMBERT, {1, 1, 1}, 0, 0};
  float *up, *wrong, eye[3] = {0, 0, 0};
  uint32_t* second;
  size_t i;
  info.size = sizeof info;
  CHECK(lambent_describe(file, 0, &info) == LAMBENT_OK && info.values == 0 && info.columns == 0);
  up = calloc(3 * info.receivers, sizeof *up), wrong = calloc(3 * info.receivers, sizeof *wrong);
  second = calloc(info.receivers, sizeof *second);
  for (i = 0; i < info.receivers; ++i) up[3 * i + 1] = 1, second[i] = 1;
#define MAKE(field, positions, normals, count, materials, of) \
  lambent_relighter_new_blocks(file, field, positions, normals, count, materials, 1, of, &r)
  CHECK(lambent_relighter_new_blocks(NULL, 0, up, up, info.receivers, &material, 1, NULL, &r) == LAMBENT_NULL);
  CHECK(lambent_relighter_new_blocks(file, 0, up, up, info.receivers, &material, 1, NULL, NULL) == LAMBENT_NULL);
  CHECK(MAKE(0, NULL, up, info.receivers, &material, NULL) == LAMBENT_NULL);
  CHECK(MAKE(0, up, NULL, info.receivers, &material, NULL) == LAMBENT_NULL);
  CHECK(MAKE(0, up, up, info.receivers, NULL, NULL) == LAMBENT_NULL);
  CHECK(MAKE(7, up, up, info.receivers, &material, NULL) == LAMBENT_ARGUMENT);
  CHECK(MAKE(0, up, up, info.receivers - 1, &material, NULL) == LAMBENT_ARGUMENT);
  CHECK(MAKE(0, up, wrong, info.receivers, &material, NULL) == LAMBENT_ARGUMENT);
  CHECK(MAKE(0, up, up, info.receivers, &material, second) == LAMBENT_ARGUMENT);
  wrong[2] = (float)NAN;
  CHECK(MAKE(0, wrong, up, info.receivers, &material, NULL) == LAMBENT_ARGUMENT);
  material.base_color[1] = 2;
  CHECK(MAKE(0, up, up, info.receivers, &material, NULL) == LAMBENT_ARGUMENT);
  material.base_color[1] = 1, material.model = 9;
  CHECK(MAKE(0, up, up, info.receivers, &material, NULL) == LAMBENT_ARGUMENT && r == NULL);
  material.model = LAMBENT_LAMBERT;
  CHECK(MAKE(0, up, up, info.receivers, &material, NULL) == LAMBENT_OK && r != NULL);
  CHECK(lambent_relight(r, wrong, 3 * info.receivers, 3) == LAMBENT_NO_LIGHT);
  CHECK(lambent_set_eye(NULL, eye) == LAMBENT_NULL && lambent_set_eye(r, NULL) == LAMBENT_NULL);
  CHECK(lambent_set_eye(r, eye) == LAMBENT_OK);
  eye[1] = (float)INFINITY;
  CHECK(lambent_set_eye(r, eye) == LAMBENT_ARGUMENT);
  CHECK(lambent_set_sky(r, 40, 0, 3, 0.2f, 1, NULL) == LAMBENT_OK);
  CHECK(lambent_relight(r, wrong, 3 * info.receivers - 1, 3) == LAMBENT_ARGUMENT);
  CHECK(lambent_relight(r, wrong, 3 * info.receivers, 3) == LAMBENT_OK);
  lambent_relighter_free(r);
  free(up), free(wrong), free(second);
}

/* A file cut short anywhere, and one of the next version. */
static void broken_files(const char* path) {
  lambent_file* file = NULL;
  size_t size = 0, n, at;
  const char version[] = "\"version\":1";
  unsigned char* bytes = read_whole(path, &size);
  CHECK(bytes != NULL && size > 0);
  if (!bytes) return;
  CHECK(lambent_open_memory(bytes, size, &file) == LAMBENT_OK);
  lambent_close(file);
  for (n = 0; n < size; n += n < 200 ? 1 : 97) {
    unsigned char* cut = malloc(n ? n : 1); /* of its own, so that a sanitizer sees a read past its end */
    memcpy(cut, bytes, n);
    file = NULL;
    CHECK(lambent_open_memory(cut, n, &file) == LAMBENT_BROKEN && file == NULL && strlen(lambent_error()) > 0);
    free(cut);
  }
  n = 0;
  for (at = 0; at + sizeof version <= size; ++at)
    if (!memcmp(bytes + at, version, sizeof version - 1)) bytes[at + sizeof version - 2] = '2', ++n;
  CHECK(n == 1);
  CHECK(lambent_open_memory(bytes, size, &file) == LAMBENT_NEWER && strstr(lambent_error(), "version 2") != NULL);
  free(bytes);
}

int main(int argc, char** argv) {
  char diffuse[4096], blocks[4096];
  lambent_file* file = NULL;
  lambent_relighter* r = NULL;
  float values[3];
  if (argc != 2) return 2;
  snprintf(diffuse, sizeof diffuse, "%s/diffuse.glb", argv[1]);
  snprintf(blocks, sizeof blocks, "%s/blocks.glb", argv[1]);
  CHECK(strlen(lambent_version()) >= 5 && strlen(lambent_error()) == 0);
  null_handles();
  CHECK(lambent_open("/nowhere/at/all.glb", &file) == LAMBENT_UNREADABLE);
  CHECK(lambent_open(argv[1], &file) == LAMBENT_UNREADABLE);
  CHECK(lambent_open(argv[0], &file) == LAMBENT_BROKEN);
  wrong_arguments(diffuse);
  broken_files(diffuse);
  CHECK(lambent_open(blocks, &file) == LAMBENT_OK);
  CHECK(lambent_relighter_new(file, 0, &r) == LAMBENT_UNSUPPORTED && r == NULL);
  CHECK(lambent_read(file, 0, 0, values, 0) == LAMBENT_UNSUPPORTED);
  wrong_blocks(file);
  lambent_close(file);
  if (!failures) printf("c_api passed\n");
  return failures != 0;
}
