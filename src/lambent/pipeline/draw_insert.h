#pragma once
// Small objects put into a relit scene.
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/parse.h>
#include <lambent/render/insert.h>

namespace lambent {

// Loads the object, bakes it alone where it stands and lights it by the lattice, relit; `into` then draws it too.
Result<void> add_insertion(const Insertion& insertion, const Lattice& lattice, int order, const Relit& free_space,
                           RelitScene& into, const Job& job);

}  // namespace lambent
