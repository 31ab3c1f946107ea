# lambent_relight: baked files without their scene, light, T . light. What an engine embeds, and what compiles to
# WebAssembly: it needs the headers of Highway, Eigen and nlohmann-json to be built, and Highway alone to be linked.
# tests/include_arrows.sh reads this list.
set(lambent_relight_sources
  src/lambent/baked/blobs.cpp
  src/lambent/baked/fields.cpp
  src/lambent/baked/gltf_buffers.cpp
  src/lambent/baked/indirect_codec.cpp
  src/lambent/baked/outgoing_codec.cpp
  src/lambent/baked/placement_codec.cpp
  src/lambent/baked/shells_codec.cpp
  src/lambent/baked/store_codec.cpp
  src/lambent/baked/wavelet_codec.cpp
  src/lambent/basis/cosine_basis.cpp
  src/lambent/basis/cubemap.cpp
  src/lambent/basis/directional.cpp
  src/lambent/basis/haar.cpp
  src/lambent/basis/hemispherical.cpp
  src/lambent/basis/symmetric.cpp
  src/lambent/basis/quadrature.cpp
  src/lambent/basis/sh.cpp
  src/lambent/basis/sh_convert.cpp
  src/lambent/basis/sh_evaluate.cpp
  src/lambent/basis/sh_product.cpp
  src/lambent/basis/sh_product_grid.cpp
  src/lambent/basis/sh_product_tile.cpp
  src/lambent/basis/sh_rotation.cpp
  src/lambent/basis/sh_rotation_zyz.cpp
  src/lambent/basis/wigner.cpp
  src/lambent/basis/zonal.cpp
  src/lambent/brdf/brdf.cpp
  src/lambent/brdf/measured.cpp
  src/lambent/brdf/microfacet.cpp
  src/lambent/brdf/phong.cpp
  src/lambent/brdf/ward.cpp
  src/lambent/c/blocks.cpp
  src/lambent/c/lambent.cpp
  src/lambent/core/color.cpp
  src/lambent/core/file.cpp
  src/lambent/core/glb.cpp
  src/lambent/core/huffman.cpp
  src/lambent/core/parallel.cpp
  src/lambent/core/sampling.cpp
  src/lambent/core/uri.cpp
  src/lambent/core/write_file.cpp
  src/lambent/light/cube_cut.cpp
  src/lambent/light/cube_light.cpp
  src/lambent/light/environment.cpp
  src/lambent/light/project.cpp
  src/lambent/light/sky.cpp
  src/lambent/relight/arriving.cpp
  src/lambent/relight/block_kernels.cpp
  src/lambent/relight/factors.cpp
  src/lambent/relight/fix_light.cpp
  src/lambent/relight/hidden_table.cpp
  src/lambent/relight/indirect.cpp
  src/lambent/relight/light.cpp
  src/lambent/relight/local_light.cpp
  src/lambent/relight/moving.cpp
  src/lambent/relight/moving_kernels.cpp
  src/lambent/relight/product_kernels.cpp
  src/lambent/relight/products.cpp
  src/lambent/relight/reflecting.cpp
  src/lambent/relight/relight.cpp
  src/lambent/relight/relight_cpca.cpp
  src/lambent/relight/relight_haar.cpp
  src/lambent/relight/relight_lattice.cpp
  src/lambent/relight/relighter.cpp
  src/lambent/relight/shining.cpp
  src/lambent/relight/zonal.cpp
  src/lambent/transfer/cpca_transfer.cpp
  src/lambent/transfer/directional.cpp
  src/lambent/transfer/directional_convert.cpp
  src/lambent/transfer/field.cpp
  src/lambent/transfer/haar_transfer.cpp
  src/lambent/transfer/indirect.cpp
  src/lambent/transfer/pack_indirect.cpp
  src/lambent/transfer/outgoing.cpp
  src/lambent/transfer/shells.cpp
  src/lambent/transfer/transfer.cpp
  src/lambent/transfer/visibility.cpp
  src/lambent/transfer/zonal_transfer.cpp
)
# One direction and many give the same bits, on every instruction set: no fused multiply-adds of the compiler's own. A
# precompiled header would bring back those that it was compiled with, within "#pragma GCC target".
set_source_files_properties(src/lambent/basis/sh_evaluate.cpp PROPERTIES COMPILE_OPTIONS -ffp-contract=off
  SKIP_PRECOMPILE_HEADERS ON)
add_library(lambent_relight STATIC ${lambent_relight_sources})
add_library(lambent::relight ALIAS lambent_relight)
set_target_properties(lambent_relight PROPERTIES EXPORT_NAME relight)
target_include_directories(lambent_relight PUBLIC
  $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/src> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
target_compile_features(lambent_relight PUBLIC cxx_std_20)
target_compile_options(lambent_relight PRIVATE ${lambent_warnings} -fno-math-errno)
target_compile_definitions(lambent_relight PRIVATE LAMBENT_VERSION="${PROJECT_VERSION}")
# Headers alone are of no concern to who links the library.
target_link_libraries(lambent_relight
  PRIVATE hwy::hwy Threads::Threads $<BUILD_INTERFACE:Eigen3::Eigen> $<BUILD_INTERFACE:nlohmann_json::nlohmann_json>)
if(LAMBENT_RELIGHT_ONLY)
  set(LAMBENT_TBB 0)  # threads of our own
else()
  set(LAMBENT_TBB 1)  # Embree's threads are TBB's: one set for the whole process
  target_link_libraries(lambent_relight PRIVATE TBB::tbb)
endif()
target_compile_definitions(lambent_relight PRIVATE LAMBENT_TBB=${LAMBENT_TBB})
if(EMSCRIPTEN)
  target_compile_options(lambent_relight PRIVATE -msimd128)
endif()
