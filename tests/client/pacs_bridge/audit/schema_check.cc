// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/client/pacs_bridge/audit/schema_check.h"

#include <cstdlib>
#include <memory>

#include <libxml/parser.h>
#include <libxml/relaxng.h>
#include <libxml/xpath.h>

#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

template <auto kFree>
struct Free {
  template <typename T>
  void operator()(T* pointer) const {
    kFree(pointer);
  }
};
using Document = std::unique_ptr<xmlDoc, Free<xmlFreeDoc>>;

Document Parse(const std::string& message) {
  return Document(xmlReadMemory(message.data(), static_cast<int>(message.size()), "message",
                                nullptr, XML_PARSE_NONET | XML_PARSE_NOERROR));
}

void AddError(void* errors, xmlErrorPtr error) {
  *static_cast<std::string*>(errors) += error->message;
}

}  // namespace

std::string SchemaErrors(const std::string& message) {
  const Document document = Parse(message);
  if (document == nullptr) return "not well formed";
  const std::string path = SourcePath("tests/client/pacs_bridge/audit/audit_message.rng");
  const std::unique_ptr<xmlRelaxNGParserCtxt, Free<xmlRelaxNGFreeParserCtxt>> parser(
      xmlRelaxNGNewParserCtxt(path.c_str()));
  const std::unique_ptr<xmlRelaxNG, Free<xmlRelaxNGFree>> schema(xmlRelaxNGParse(parser.get()));
  if (schema == nullptr) std::abort();
  const std::unique_ptr<xmlRelaxNGValidCtxt, Free<xmlRelaxNGFreeValidCtxt>> validator(
      xmlRelaxNGNewValidCtxt(schema.get()));
  std::string errors;
  xmlRelaxNGSetValidStructuredErrors(validator.get(), &AddError, &errors);
  const int result = xmlRelaxNGValidateDoc(validator.get(), document.get());
  return result == 0 ? "" : errors.empty() ? "invalid" : errors;
}

std::string ValuesOf(const std::string& message, const std::string& xpath) {
  const Document document = Parse(message);
  const std::unique_ptr<xmlXPathContext, Free<xmlXPathFreeContext>> context(
      xmlXPathNewContext(document.get()));
  const std::unique_ptr<xmlXPathObject, Free<xmlXPathFreeObject>> found(
      xmlXPathEvalExpression(reinterpret_cast<const xmlChar*>(xpath.c_str()), context.get()));
  std::string values;
  const xmlNodeSet* const nodes = found == nullptr ? nullptr : found->nodesetval;
  for (int i = 0; nodes != nullptr && i < nodes->nodeNr; ++i) {
    xmlChar* const content = xmlNodeGetContent(nodes->nodeTab[i]);
    if (i > 0) values += ",";
    values += reinterpret_cast<const char*>(content);
    xmlFree(content);
  }
  return values;
}

}  // namespace tissueform::testing
