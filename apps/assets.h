// Where the shipped files are: beside the sources, or in share/dofusion of an installed tree.
#pragma once

#include <string>

namespace dofusion {

// The folder `assets`; the environment variable DOFUSION_ASSETS overrides. Throws InputError if there is none.
std::string assets_directory();

std::string default_model_path();  // assets/models/default.safetensors

}  // namespace dofusion
