// Small pieces of HTML that the reports share.
#pragma once

#include <string>

namespace dofusion {

std::string html_escaped(const std::string& text);
std::string base64(const std::string& bytes);
std::string png_image(const std::string& png, const std::string& alt);  // <img> with the picture inside

// Head with the reports' style sheet, up to the open <main>; the matching end. Its policy lets the page load nothing from
// outside.
std::string html_begin(const std::string& title);
std::string html_end();

}  // namespace dofusion
