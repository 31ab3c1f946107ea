#pragma once
// Small objects put into a relit scene.
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/parse.h>
#include <lambent/render/insert.h>

#include <memory>

namespace lambent {

// An object where it stands, and what it does to light that comes to it: own shadows, and one bounce.
struct InsertedObject {
  Insertion of;
  Scene scene;
  Receivers receivers;
  Transfer transfer;
};

// Loads the object and puts it in its place, and says where it reaches out of the lattice's box. Errors: of files; a
// scale that makes it too large.
Result<Scene> place_object(const Insertion& insertion, const Lattice& lattice, const Job& job);

// Bakes an object alone, for light of a lattice of that order. Errors: cancelled.
Result<InsertedObject> bake_object(const Insertion& insertion, Scene object, int order, const Job& job);

// Loads the object and bakes it alone where it stands, for light of a lattice of that order. Errors: of files;
// cancelled.
Result<std::shared_ptr<const InsertedObject>> make_inserted(const Insertion& insertion, const Lattice& lattice,
                                                            int order, const Job& job);

}  // namespace lambent
