// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/ct/itk_setup.h"

#include <itkMultiThreaderBase.h>
#include <itkObject.h>

namespace tissueform {

void SetUpItk() {
  // The default is a pool of threads, which a child process does not inherit: it would wait for
  // ever.
  itk::MultiThreaderBase::SetGlobalDefaultThreader(itk::MultiThreaderBase::ThreaderEnum::Platform);
  itk::Object::GlobalWarningDisplayOff();
}

}  // namespace tissueform
