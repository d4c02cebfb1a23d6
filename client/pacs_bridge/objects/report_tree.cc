// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/report_tree.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmsr/dsrdoc.h>

namespace tissueform {
namespace {

DSRCodedEntryValue Entry(const CodedTerm& term) {
  return {term.value.c_str(), term.scheme.c_str(), term.meaning.c_str()};
}

}  // namespace

struct ReportTree::Impl {
  DSRDocument document{DSRTypes::DT_ComprehensiveSR};
  absl::Status status;

  void Check(const OFCondition& done, const CodedTerm& name) {
    if (done.bad() && status.ok()) {
      status = absl::InternalError(
          absl::StrCat("the report's item ", name.value, " cannot be written: ", done.text()));
    }
  }

  DSRContentItem& Current() { return document.getTree().getCurrentContentItem(); }

  // Goes down to the new item, also where it could not be made: Up() belongs to it.
  bool Down(DSRTypes::E_RelationshipType relation, DSRTypes::E_ValueType type,
            const CodedTerm& name) {
    const bool made =
        document.getTree().addContentItem(relation, type, DSRTypes::AM_belowCurrent) > 0;
    Check(made ? EC_Normal : EC_IllegalCall, name);
    if (made) Check(Current().setConceptName(Entry(name)), name);
    return made;
  }
  void AddTo(DSRSOPInstanceReferenceList& evidence, const std::string& study_uid,
             const std::string& series_uid, const std::string& class_uid,
             const std::string& instance_uid) {
    Check(evidence.addItem(study_uid.c_str(), series_uid.c_str(), class_uid.c_str(),
                           instance_uid.c_str()),
          {"evidence", "", ""});
  }
  void Up() { document.getTree().goUp(); }

  void AddCode(DSRTypes::E_RelationshipType relation, const CodedTerm& name,
               const CodedTerm& value) {
    if (!Down(relation, DSRTypes::VT_Code, name)) return;
    Check(Current().setCodeValue(Entry(value)), name);
    Up();
  }
  void AddString(DSRTypes::E_RelationshipType relation, DSRTypes::E_ValueType type,
                 const CodedTerm& name, const std::string& text) {
    if (!Down(relation, type, name)) return;
    Check(Current().setStringValue(text.c_str()), name);
    Up();
  }
};

ReportTree::ReportTree(const CodedTerm& title) : impl_(std::make_unique<Impl>()) {
  DSRDocumentTree& tree = impl_->document.getTree();
  if (tree.addContentItem(DSRTypes::RT_isRoot, DSRTypes::VT_Container) == 0) {
    impl_->status = absl::InternalError("the report's root cannot be made");
    return;
  }
  impl_->Check(impl_->Current().setConceptName(Entry(title)), title);
}

ReportTree::~ReportTree() = default;

void ReportTree::Open(const CodedTerm& name) {
  impl_->Down(DSRTypes::RT_contains, DSRTypes::VT_Container, name);
}

void ReportTree::Close() { impl_->Up(); }

void ReportTree::AddText(const CodedTerm& name, const std::string& text) {
  impl_->AddString(DSRTypes::RT_contains, DSRTypes::VT_Text, name, text);
}

void ReportTree::AddCode(const CodedTerm& name, const CodedTerm& value) {
  impl_->AddCode(DSRTypes::RT_contains, name, value);
}

void ReportTree::AddNumber(const CodedTerm& name, double value, const std::string& unit,
                           const CodedTerm& derivation) {
  if (!impl_->Down(DSRTypes::RT_contains, DSRTypes::VT_Num, name)) return;
  const double rounded = std::round(value * 1e4) / 1e4 + 0.0;  // no minus before a zero
  const DSRNumericMeasurementValue number(absl::StrFormat("%.4f", rounded).c_str(),
                                          Entry(UnitTerm(unit)));
  impl_->Check(impl_->Current().setNumericValue(number), name);
  if (!derivation.value.empty()) {
    impl_->AddCode(DSRTypes::RT_hasConceptMod, {"121401", "DCM", "Derivation"}, derivation);
  }
  impl_->Up();
}

void ReportTree::AddContext(const std::string& device_name, const std::string& device_uid) {
  impl_->AddCode(DSRTypes::RT_hasConceptMod,
                 {"121049", "DCM", "Language of Content Item and Descendants"},
                 {"en", "RFC5646", "English"});
  impl_->AddCode(DSRTypes::RT_hasObsContext, {"121005", "DCM", "Observer Type"},
                 {"121007", "DCM", "Device"});
  impl_->AddString(DSRTypes::RT_hasObsContext, DSRTypes::VT_UIDRef,
                   {"121012", "DCM", "Device Observer UID"}, device_uid);
  impl_->AddString(DSRTypes::RT_hasObsContext, DSRTypes::VT_Text,
                   {"121013", "DCM", "Device Observer Name"}, device_name);
}

void ReportTree::AddReference(const CodedTerm& name, absl::string_view class_uid,
                              const std::string& instance_uid) {
  if (!impl_->Down(DSRTypes::RT_contains, DSRTypes::VT_Composite, name)) return;
  const DSRCompositeReferenceValue reference(std::string(class_uid).c_str(), instance_uid.c_str());
  impl_->Check(impl_->Current().setCompositeReference(reference), name);
  impl_->Up();
}

void ReportTree::AddEvidence(const std::string& study_uid, const std::string& series_uid,
                             const std::string& class_uid, const std::string& instance_uid) {
  impl_->AddTo(impl_->document.getCurrentRequestedProcedureEvidence(), study_uid, series_uid,
               class_uid, instance_uid);
}

void ReportTree::AddOtherEvidence(const std::string& study_uid, const std::string& series_uid,
                                  const std::string& class_uid, const std::string& instance_uid) {
  impl_->AddTo(impl_->document.getPertinentOtherEvidence(), study_uid, series_uid, class_uid,
               instance_uid);
}

absl::Status ReportTree::Write(DcmDataset* object) {
  impl_->Check(impl_->document.completeDocument(), {"completion", "", ""});
  if (!impl_->status.ok()) return impl_->status;
  impl_->Check(impl_->document.write(*object), {"whole", "", ""});
  return impl_->status;
}

}  // namespace tissueform
