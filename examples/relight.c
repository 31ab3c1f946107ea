/* Relights a baked file from C:  relight BAKED.glb [SUN_ELEVATION [SUN_AZIMUTH]] */
#include <lambent.h>
#include <stdio.h>
#include <stdlib.h>

static int complain(void) {
  fprintf(stderr, "%s\n", lambent_error());
  return 1;
}

int main(int argc, char** argv) {
  lambent_file* file = NULL;
  lambent_relighter* relighter = NULL;
  lambent_info info;
  lambent_part part;
  float *rgb, mean[3] = {0, 0, 0};
  size_t floats, i, p;
  info.size = sizeof info, part.size = sizeof part;
  if (argc < 2) return fprintf(stderr, "usage: relight BAKED.glb [SUN_ELEVATION [SUN_AZIMUTH]]\n"), 2;

  /* What is in the file, and whose vertices its receivers are. */
  if (lambent_open(argv[1], &file) || lambent_describe(file, 0, &info)) return complain();
  printf("%s at %lu %s, %lu rows of %s, %lu columns\n", info.store, (unsigned long)info.receivers, info.placement,
         (unsigned long)info.rows, info.meaning, (unsigned long)info.columns);
  for (p = 0; p < info.parts; ++p) {
    if (lambent_get_part(file, p, &part)) return complain();
    printf("node %d, primitive %d: %lu\n", part.node, part.primitive, (unsigned long)part.count);
  }

  /* The light; lamps of the scene shine as they are. */
  if (lambent_relighter_new(file, 0, &relighter)) return complain();
  lambent_close(file); /* the relighter keeps what it needs */
  if (info.sh_order || info.lobes)
    if (lambent_set_sky(relighter, argc > 2 ? (float)atof(argv[2]) : 35, argc > 3 ? (float)atof(argv[3]) : 45, 3, 0.2f,
                        1, NULL))
      return complain();

  /* T . light: once a frame, as often as the light changes. */
  floats = info.receivers * info.rows * 3;
  rgb = malloc((floats + 1) * sizeof *rgb);
  if (!rgb || lambent_relight(relighter, rgb, floats, info.rows * 3)) return complain();
  for (i = 0; i < info.receivers; ++i)
    for (p = 0; p < 3; ++p) mean[p] += rgb[i * info.rows * 3 + p] / (float)info.receivers;
  for (i = 0; i < info.receivers && i < 3; ++i)
    printf("receiver %lu: %.4f %.4f %.4f\n", (unsigned long)i, rgb[i * info.rows * 3], rgb[i * info.rows * 3 + 1],
           rgb[i * info.rows * 3 + 2]);
  printf("mean: %.4f %.4f %.4f\n", mean[0], mean[1], mean[2]);
  free(rgb);
  lambent_relighter_free(relighter);
  return 0;
}
