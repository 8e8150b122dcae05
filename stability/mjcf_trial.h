// A look at a user's MJCF file from a safe place. Private to stability.
#pragma once

#include <string>

namespace dofusion {

// Has a child process build the file. MuJoCo's compiler may crash on a bad file (a mesh with a negative index), print
// pages (a flat mesh), take all memory (2e9 numbers of user data) or end the process; the child takes that on itself.
// Throws InputError naming the file, with MuJoCo's reason in one line, if the child does not succeed, within a minute
// of processor time and 8 GB. The caller holds the lock on MuJoCo's reader.
void try_mjcf(const std::string& path);

}  // namespace dofusion
