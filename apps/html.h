// Small pieces of HTML that the reports share.
#pragma once

#include <string>

namespace dofusion {

std::string html_escaped(const std::string& text);
std::string base64(const std::string& bytes);
// <img> with the picture inside; `bytes` is a PNG or JPEG file.
std::string embedded_image(const std::string& bytes, const std::string& alt);

// Head with the reports' style sheet, up to the open <main>; the matching end. Its policy lets the page load nothing from
// outside.
std::string html_begin(const std::string& title);
std::string html_end();

}  // namespace dofusion
