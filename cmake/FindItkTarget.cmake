# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# tissueform::itk: the modules of ITK that core/imaging/ct and core/imaging/anatomy use, as one target. ITK's own use file would add its
# folders to every target of the project and register every format; we name ours.

find_package(ITK 5.2 CONFIG REQUIRED COMPONENTS
             ITKCommon ITKIOGDCM ITKGDCM ITKIONIFTI ITKIONRRD ITKIOMeta ITKImageGrid ITKImageIntensity ITKImageLabel
             ITKThresholding ITKConnectedComponents ITKMathematicalMorphology ITKBinaryMathematicalMorphology
             ITKDistanceMap ITKWatersheds ITKSmoothing ITKLabelMap ITKRegionGrowing)
add_library(tissueform_itk INTERFACE)
add_library(tissueform::itk ALIAS tissueform_itk)
target_include_directories(tissueform_itk SYSTEM INTERFACE ${ITK_INCLUDE_DIRS})
target_link_libraries(tissueform_itk INTERFACE ${ITK_LIBRARIES})
# Debian's headers refuse every compiler but GCC.
target_compile_options(tissueform_itk INTERFACE
  "$<$<COMPILE_LANG_AND_ID:CXX,Clang>:SHELL:-include ${CMAKE_CURRENT_LIST_DIR}/precompiled/itk_with_clang.h>")
