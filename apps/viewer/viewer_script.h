// The script of the report's 3D view, made when the toolkit is built.
#pragma once

#include <string_view>

namespace dofusion {

// JavaScript for a page that has the elements of viewer.js; it needs nothing from outside. Empty if the toolkit was
// built without the viewer.
std::string_view viewer_script();

}  // namespace dofusion
