#include "apps/html.h"

#include <cstdint>

namespace dofusion {

std::string html_escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string base64(const std::string& bytes) {
  static const char* const digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto byte = [&](std::size_t k) {
      return i + k < bytes.size() ? static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[i + k])) : 0u;
    };
    const std::uint32_t group = byte(0) << 16 | byte(1) << 8 | byte(2);
    out += digits[group >> 18 & 63];
    out += digits[group >> 12 & 63];
    out += i + 1 < bytes.size() ? digits[group >> 6 & 63] : '=';
    out += i + 2 < bytes.size() ? digits[group & 63] : '=';
  }
  return out;
}

std::string embedded_image(const std::string& bytes, const std::string& alt) {
  const std::string type = bytes.rfind("\xff\xd8", 0) == 0 ? "jpeg" : "png";
  return "<img alt=\"" + html_escaped(alt) + "\" src=\"data:image/" + type + ";base64," + base64(bytes) + "\">";
}

std::string html_begin(const std::string& title) {
  return R"(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
      content="default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<title>)" +
         html_escaped(title) + R"(</title>
<style>
  :root { --ink: #1c2430; --soft: #5c6675; --line: #dfe3e8; --good: #1a7f4b; --bad: #b3402a; }
  body { font: 15px/1.5 system-ui, "Segoe UI", Roboto, Helvetica, Arial, sans-serif; color: var(--ink); margin: 0;
         background: #f6f7f9; }
  main { max-width: 1080px; margin: 0 auto; padding: 28px 24px 48px; background: #fff; }
  h1 { font-size: 25px; margin: 0 0 4px; } h2 { font-size: 18px; margin: 32px 0 10px; }
  p.lead { font-size: 17px; margin: 0 0 12px; } .soft { color: var(--soft); }
  .row { display: grid; gap: 14px; grid-template-columns: repeat(3, 1fr); }
  .pairs { display: grid; gap: 14px; grid-template-columns: repeat(2, 1fr); }
  figure { margin: 0; } figcaption { font-size: 13px; color: var(--soft); margin-top: 3px; }
  img { width: 100%; height: auto; border: 1px solid var(--line); border-radius: 4px; display: block; }
  table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; font-size: 14px; }
  th, td { text-align: right; padding: 4px 10px; border-bottom: 1px solid var(--line); }
  th:first-child, td:first-child, th.text, td.text { text-align: left; }
  th { color: var(--soft); font-weight: 600; } .good { color: var(--good); } .bad { color: var(--bad); }
  td.wide { white-space: nowrap; } .list { overflow-x: auto; }
  summary { cursor: pointer; font-size: 18px; font-weight: 700; margin: 28px 0 10px; }
  @media (max-width: 720px) {
    main { padding: 20px 16px 32px; } .row, .pairs { grid-template-columns: 1fr; }
    table { font-size: 13px; display: block; overflow-x: auto; } th { font-size: 12px; } th, td { padding: 4px 5px; }
    .wide { display: none; } main { overflow-wrap: anywhere; }
  }
</style>
</head>
<body>
<main>
)";
}

std::string html_end() { return "</main>\n</body>\n</html>\n"; }

}  // namespace dofusion
