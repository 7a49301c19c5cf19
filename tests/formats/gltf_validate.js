// Prints the report of Khronos' validator on one file as JSON: node gltf_validate.js FILE
const fs = require("fs");
const validator = require("gltf-validator");

validator
  .validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])), { maxIssues: 0 })
  .then((report) => console.log(JSON.stringify(report)), (error) => { console.error(error); process.exit(1); });
