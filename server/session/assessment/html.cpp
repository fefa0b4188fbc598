#include "server/session/assessment/html.h"

#include <openssl/evp.h>

#include "common/base/printable.h"
#include "common/base/quote.h"

namespace trocar::assessment {
namespace {

constexpr const char* kStyle = R"(
body { font: 15px/1.45 system-ui, sans-serif; color: #1b1b1b; background: #fff;
       max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: .2rem; }
h2 { font-size: 1.2rem; margin-top: 2rem; border-bottom: 1px solid #bbb; }
.points { font-size: 2.2rem; font-weight: 600; }
.bar { display: inline-block; height: .7rem; background: #0072b2; vertical-align: middle; }
.note { border-left: 4px solid #d55e00; padding-left: .6rem; }
.small { color: #555; font-size: .85rem; }
table { border-collapse: collapse; margin: .8rem 0; }
th, td { text-align: left; padding: .2rem .9rem .2rem 0; border-bottom: 1px solid #e4e4e4; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; }
img { max-width: 100%; height: auto; }
figure { margin: 1rem 0; }
figure.plot img { width: 44rem; max-width: 100%; }
.pair figure { display: inline-block; width: 48%; vertical-align: top; }
.pictures figure { display: inline-block; width: 31%; vertical-align: top; }
.wide { overflow-x: auto; }
@media print { body { margin: 0; max-width: none; font-size: 11px; }
               h2 { break-after: avoid; } table, figure, li { break-inside: avoid; } }
@page { size: A4; margin: 15mm; }
)";

std::string base64_of(std::string_view bytes) {
  std::string out(4 * ((bytes.size() + 2) / 3) + 1, '\0');
  const int size = EVP_EncodeBlock(reinterpret_cast<unsigned char*>(out.data()),
                                   reinterpret_cast<const unsigned char*>(bytes.data()),
                                   static_cast<int>(bytes.size()));
  out.resize(static_cast<std::size_t>(size));
  return out;
}

}  // namespace

std::string html_text(std::string_view text) {
  return html_escaped(printable(text, 20'000));
}

std::string html_image(std::string_view type, std::string_view bytes, const std::string& words) {
  return "<img alt=\"" + html_text(words) + "\" src=\"data:" + std::string(type) + ";base64," +
         base64_of(bytes) + "\">\n";
}

std::string html_page(const std::string& title, const std::string& body) {
  return "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" +
         html_text(title) + "</title>\n<style>" + kStyle + "</style>\n</head>\n<body>\n" + body +
         "</body>\n</html>\n";
}

}  // namespace trocar::assessment
