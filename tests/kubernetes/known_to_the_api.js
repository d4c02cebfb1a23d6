// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
//   node known_to_the_api.js FOLDER_OF_NODE_MODULES <objects.json
//
// Judges Kubernetes objects by the validators of the npm package kubernetes-models, which were made from the API's own
// schema: types, formats, what must be there. A field that none of them reads is none of the API's. One complaint a line.
const path = require("path");

const modules = process.argv[2];
const objects = JSON.parse(require("fs").readFileSync(0, "utf8"));

// "apps/v1" StatefulSet is IoK8sApiAppsV1StatefulSet, "v1" Service IoK8sApiCoreV1Service.
function validatorOf(object) {
  const [version, group = "core"] = object.apiVersion.split("/").reverse();
  const words = [group.replace(/\.k8s\.io$/, ""), version].map((word) => word[0].toUpperCase() + word.slice(1));
  return require(path.join(modules, "kubernetes-models/_schemas", `IoK8sApi${words.join("")}${object.kind}.js`)).validate;
}

// Notes in `read` which fields somebody asks for.
function observed(value, where, read) {
  if (value === null || typeof value !== "object") return value;
  return new Proxy(value, {
    get(target, name) {
      if (typeof name !== "string" || !Object.hasOwn(target, name)) return target[name];
      read.add(`${where}/${name}`);
      return observed(target[name], `${where}/${name}`, read);
    },
  });
}

function* fieldsOf(value, where) {
  if (value === null || typeof value !== "object") return;
  for (const name of Object.keys(value)) {
    yield `${where}/${name}`;
    yield* fieldsOf(value[name], `${where}/${name}`);
  }
}

for (const object of objects) {
  const name = `${object.kind} ${object.metadata && object.metadata.name}`;
  let validate;
  try {
    validate = validatorOf(object);
  } catch {
    console.log(`${name}: ${object.apiVersion} has no such kind`);
    continue;
  }
  const read = new Set();
  if (!validate(observed(object, "", read))) {
    for (const error of validate.errors) console.log(`${name}: ${error.instancePath} ${error.keyword} ${JSON.stringify(error.params)}`);
  }
  // Not below what is unknown itself.
  const isKnown = (field) => field === "" || read.has(field);
  const unknown = [...fieldsOf(object, "")].filter((field) => !isKnown(field) && isKnown(field.slice(0, field.lastIndexOf("/"))));
  for (const field of unknown) console.log(`${name}: ${field} is no field of the API`);
}
